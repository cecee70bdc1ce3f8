function traces(p) {
  const line = (x, y, c, axis) => ({x, y, mode: "lines", line: {color: c, width: 1.8}, yaxis: axis,
    hovertemplate: "%{y:.4g} " + p.unit + " at %{x:.3f} s<extra></extra>", connectgaps: false});
  const dots = (x, y, c, axis) => ({...line(x, y, c, axis), mode: "markers", marker: {color: c, size: 4}});
  const fitted = colour("--fitted"), predicted = colour("--predicted"), seen = colour("--observed");
  const found = [dots(p.time, p.observed, seen, "y")];
  for (const [part, c] of [[p.fitted, fitted], [p.predicted, predicted]]) {
    if (!part) continue;
    const band = {x: part.time.concat([...part.time].reverse()), y: part.upper.concat([...part.lower].reverse()),
      fill: "toself", fillcolor: faint(c, 0.18), line: {width: 0}, hoverinfo: "skip", yaxis: "y", mode: "lines"};
    found.push(band, line(part.time, part.value, c, "y"));
    if (!p.alone) found.push(dots(part.error_time, part.error, c, "y2"));
  }
  if (p.filled) found.push({...dots(p.filled.time, p.filled.value, colour("--filled"), "y"),
    error_y: {array: p.filled.half, color: colour("--filled"), thickness: 1, width: 0}});
  return found;
}
function layout(p, width, height) {
  const grid = colour("--line");
  const axis = (title) => ({title: {text: title, font: {size: 12}}, gridcolor: grid, zerolinecolor: grid, automargin: true});
  const error = {yaxis2: {...axis(titled("error", p.unit)), domain: [0, 0.27]}};
  return {
    ...look(width, height), title: {text: p.title, font: {size: 14}, x: 0.01, xanchor: "left", y: 0.98},
    margin: {l: 56, r: 12, t: 34, b: 64}, dragmode: "zoom",
    xaxis: {...axis("time [s]"), anchor: p.alone ? "y" : "y2"},
    yaxis: {...axis(titled(p.quantity, p.unit)), domain: [p.alone ? 0 : 0.34, 1]},
    ...(p.alone ? {} : error),
    shapes: p.window ? [{type: "rect", xref: "x", yref: "paper", x0: p.window[0], x1: p.window[1], y0: 0, y1: 1,
      fillcolor: faint(colour("--fitted"), 0.06), line: {width: 0}, layer: "below"}] : [],
  };
}
keepDrawn((number, place, width) =>
  plot(place, traces(PLOTS[number]), layout(PLOTS[number], width, place.clientHeight)));
