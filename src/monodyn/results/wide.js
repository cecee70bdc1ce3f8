// A table that is wider than its place says so above its first column, which stays in sight.
const tables = new ResizeObserver(() => document.querySelectorAll(".scroll").forEach((place) =>
  place.classList.toggle("wide", place.scrollWidth > place.clientWidth + 1)));
document.querySelectorAll(".scroll, .scroll table").forEach((each) => tables.observe(each));
