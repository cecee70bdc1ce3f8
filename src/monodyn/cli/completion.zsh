#compdef monodyn
# monodyn for zsh: eval "$(monodyn completion zsh)" after compinit, or as the file _monodyn in the fpath
_monodyn() {
  local before=$words[CURRENT-1]
  local -a found
  if [[ $PREFIX == --*=* ]]; then
    before=${PREFIX%%=*}
    compset -P 1 '*='
  fi
  if (( CURRENT == 2 )); then
    found=(@COMMANDS@)
  else
    case "$words[2] $before" in
@VALUES@
    (*)
      case "$words[2] $PREFIX" in
@OPTIONS@
      esac ;;
    esac
  fi
  compadd -a found || _files
}
if [[ $funcstack[1] == _monodyn ]]; then _monodyn "$@"; else compdef _monodyn monodyn; fi
