// Every figure of the page, each with the data beside it.
const ways = { charts: enlivenCharts, maps: enlivenMaps, solids: enlivenSolid };
const begun = [...document.querySelectorAll("figure")].map(async (figure) => {
  const way = ways[figure.className], data = figure.querySelector("script");
  if (way && data) await way(figure, JSON.parse(data.textContent));
});
document.documentElement.classList.remove("still");
Promise.all(begun).then(() => { document.documentElement.dataset.ready = "yes"; });
