"use strict";
// Replaces the static plots of the page by interactive ones, and handles the choice of total and of angle.
(() => {
  const config = {
    responsive: true,
    displaylogo: false,
    // Listed explicitly: the default set contains a button that uploads the plot.
    modeBarButtons: [["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]],
  };
  const views = (drawing, total) =>
    drawing.data.map((trace) => trace.meta === "activity" || trace.meta === total);

  const edges = (drawing, number) =>
    drawing.data[number].meta.edges.map((edge) => ({
      type: "line", xref: "paper", x0: 0, x1: 1, y0: edge, y1: edge,
      line: { color: "#b92d2b", width: 1, dash: "dash" },
    }));

  const drawings = [];
  for (const figure of document.querySelectorAll("figure.plot")) {
    const { data, layout } = JSON.parse(document.getElementById(figure.dataset.figure).textContent);
    const drawing = figure.querySelector(".drawing");
    const gaps = layout.shapes || [];
    for (const part of [figure, ...figure.querySelectorAll(".live")]) part.hidden = false;
    figure.querySelectorAll(".still").forEach((still) => still.classList.add("replaced"));
    const narrow = window.innerWidth < 600;
    if (narrow) {
      // Touch must scroll the page, not the plot.
      layout.dragmode = false;
      layout.margin.t = 26;
      layout.margin.r = 8;
      for (const name of (layout.annotations || []).filter((note) => note.xref === "paper")) name.xanchor = "right";
      layout.margin.l = 46;
      layout.xaxis.nticks = 5;
      if (layout.yaxis2) layout.yaxis2.ticktext = layout.yaxis2.ticktext.map((text) => text.slice(0, 6));
    }
    drawings.push(
      Plotly.newPlot(drawing, data, layout, { ...config, displayModeBar: narrow ? false : "hover" }).then(() => {
        const select = figure.querySelector("select");
        if (select) {
          const show = () => {
            const number = Number(select.value);
            const shapes = [...gaps, ...edges(drawing, number)];
            const visible = data.map((_, index) => index === number);
            return Plotly.update(drawing, { visible }, { shapes, "yaxis.autorange": true });
          };
          select.addEventListener("change", show);
          return show();
        }
        for (const choice of figure.querySelectorAll("input[type=radio]")) {
          choice.addEventListener("change", () => Plotly.restyle(drawing, { visible: views(drawing, choice.value) }));
        }
        return null;
      }),
    );
  }
  // On paper, collapsed details cannot be opened.
  window.addEventListener("beforeprint", () => {
    for (const details of document.querySelectorAll("details")) details.open = true;
  });
  Promise.all(drawings).then(() => document.documentElement.setAttribute("data-drawn", String(drawings.length)));
})();
