"use strict";
// Draws the plots of the page.
(() => {
  const plots = JSON.parse(document.getElementById("plots").textContent);
  const drawings = [];
  for (const [id, figures] of Object.entries(plots)) {
    for (const figure of figures) {
      const place = document.getElementById(id).appendChild(document.createElement("div"));
      drawings.push(Plotly.newPlot(place, figure.data, figure.layout, { responsive: true, displayModeBar: false }));
    }
  }
  Promise.all(drawings).then((drawn) => {
    // On screen a plot is as wide as its card; for print the width is set to that of the paper [px].
    const widths = (single, small) => {
      for (const place of drawn) {
        Plotly.relayout(place, { width: place.parentElement.classList.contains("small") ? small : single });
      }
    };
    window.addEventListener("beforeprint", () => widths(690, 165));
    window.addEventListener("afterprint", () => widths(null, null));
    document.documentElement.dataset.drawn = String(drawn.length);
  });
})();
