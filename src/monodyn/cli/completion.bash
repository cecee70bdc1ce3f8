# monodyn for bash: eval "$(monodyn completion bash)"
_monodyn() {
  local words= cur=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]}
  # --method=fast is three words for bash
  [ "$before" = = ] && before=${COMP_WORDS[COMP_CWORD-2]}
  [ "$cur" = = ] && cur=
  if [ "$COMP_CWORD" = 1 ]; then
    words='@COMMANDS@'
  else
    case "${COMP_WORDS[1]} $before" in
@VALUES@
    *)
      case "${COMP_WORDS[1]} $cur" in
@OPTIONS@
      esac ;;
    esac
  fi
  COMPREPLY=($(compgen -W "$words" -- "$cur"))
}
complete -o default -F _monodyn monodyn
