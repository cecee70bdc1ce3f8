// Keeps every plot as wide as its card, in the colours of the page; on paper as wide as that, in light colours.
const SHEET = 700;
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const faint = (hex, share) => hex + Math.round(share * 255).toString(16).padStart(2, "0");
const titled = (quantity, unit) => quantity + (unit ? " [" + unit + "]" : "");
function look(width, height) {
  return {width, height, showlegend: false, hovermode: "closest", paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)", font: {color: colour("--ink"), size: 12},
    modebar: {bgcolor: "rgba(0,0,0,0)", color: colour("--soft"), activecolor: colour("--ink")}};
}
function plot(place, data, layout) {
  Plotly.react(place, data, layout, {responsive: false, displaylogo: false,
    displayModeBar: layout.width < 620 ? false : "hover", modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"]});
}
// draw(number, place, width, printed) draws the plot of a card
function keepDrawn(draw) {
  const cards = [...document.querySelectorAll(".plot")], drawn = new Map();
  let printed = false;
  const one = (place) => {
    // a card that is hidden has no width
    if (place.clientWidth < 50) return;
    drawn.set(place, place.clientWidth);
    draw(Number(place.id.slice("plot".length)), place, printed ? SHEET : place.clientWidth, printed);
  };
  const all = () => cards.forEach(one);
  const print = (on) => { printed = on; document.documentElement.classList.toggle("printed", on); all(); };
  // the card's own width decides, whatever changed it: the window, a scroll bar
  const watch = new ResizeObserver((entries) => entries.forEach(({target}) => {
    if (!printed && drawn.get(target) !== target.clientWidth) one(target);
  }));
  all();
  cards.forEach((place) => watch.observe(place));
  dark.addEventListener("change", all);
  window.addEventListener("beforeprint", () => print(true));
  window.addEventListener("afterprint", () => print(false));
}
