"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer;
  const time = data.time.packed ? new Float64Array(bytes(data.time.packed))
    : Float64Array.from({ length: data.time.count }, (_, k) => data.time.start + k * data.time.step);
  const columns = data.columns.map(c => ({ ...c, values: new Float32Array(bytes(c.packed)) }));
  columns.forEach(c => { delete c.packed; });
  const panels = [];
  for (const c of columns) {
    const key = c.unit || c.name;
    let panel = panels.find(p => p.key === key);
    if (!panel) panels.push(panel = { key, unit: c.unit, columns: [] });
    panel.columns.push(c);
  }
  // First row at or after a time.
  const from = x => { let a = 0, b = time.length; while (a < b) { const m = (a + b) >> 1; if (time[m] < x) a = m + 1; else b = m; } return a; };
  // Rows that can be told apart between two times: of each stripe the least and the greatest of every column.
  const visible = (panel, low, high, stripes) => {
    const first = Math.max(0, from(low) - 1), last = Math.min(time.length, from(high) + 1);
    let rows;
    if (last - first <= 4 * stripes) {
      rows = Array.from({ length: last - first }, (_, k) => first + k);
    } else {
      const keep = new Set([first, last - 1]);
      for (const { values } of panel.columns) {
        for (let s = 0; s < stripes; s++) {
          const a = first + Math.floor((last - first) * s / stripes), b = first + Math.floor((last - first) * (s + 1) / stripes);
          let least = a, most = a;
          for (let k = a + 1; k < b; k++) { if (values[k] < values[least]) least = k; if (values[k] > values[most]) most = k; }
          keep.add(least); keep.add(most);
        }
      }
      rows = [...keep].sort((a, b) => a - b);
    }
    return [rows.map(k => time[k]), ...panel.columns.map(c => rows.map(k => Number.isFinite(c.values[k]) ? c.values[k] : null))];
  };
  const LIGHT = ["#1257b8", "#d1480c", "#217a2c", "#7c2fa8", "#00757f", "#b3193f", "#80640a", "#555555"];
  const DARK = ["#7db2ff", "#ff9a62", "#79d184", "#d09bf2", "#54d2dc", "#ff8aa5", "#e0c050", "#b8b8b8"];
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const place = document.getElementById("charts");
  const whole = [time[0], time[time.length - 1]];
  const charts = [];
  let busy = false;
  const stripes = () => Math.max(300, Math.min(1600, Math.floor(place.clientWidth)));
  const draw = night => {
    const range = charts.length ? [charts[0].scales.x.min, charts[0].scales.x.max] : whole;
    charts.splice(0).forEach(chart => chart.destroy());
    const ink = night ? "#e8e8e8" : "#1a1a1a", grid = night ? "#3a3d45" : "#dddddd", colours = night ? DARK : LIGHT;
    panels.forEach((panel, p) => {
      const axis = { stroke: ink, grid: { stroke: grid, width: 1 }, ticks: { stroke: grid, width: 1 } };
      const label = panel.columns.length === 1 ? panel.columns[0].name + (panel.unit ? ` [${panel.unit}]` : "") : `[${panel.unit}]`;
      const chart = new uPlot({
        width: place.clientWidth, height: 220, cursor: { sync: { key: "time" }, drag: { x: true, y: false } },
        scales: { x: { time: false, range: (u, low, high) => [low, high] } },
        axes: [{ ...axis, label: p + 1 === panels.length ? data.time.label : undefined, labelSize: 20 }, { ...axis, label, size: 70, labelSize: 20 }],
        series: [{ label: data.time.label }, ...panel.columns.map((c, k) => ({ label: c.name + (c.unit ? ` [${c.unit}]` : ""), stroke: colours[k % 8], width: 1.3, points: { show: false }, value: (u, v) => v == null ? "" : v.toPrecision(6) }))],
        hooks: { setScale: [(u, key) => { if (key === "x" && !busy) show(u.scales.x.min, u.scales.x.max); }] },
      }, visible(panel, range[0], range[1], stripes()), place.children[p]);
      chart.over.addEventListener("dblclick", () => show(whole[0], whole[1]));
      charts.push(chart);
    });
    show(range[0], range[1]);
  };
  // All charts show one stretch of time, with as many points as it needs.
  const show = (low, high) => {
    if (low == null || high == null || !(high > low)) return;
    busy = true;
    charts.forEach((chart, p) => chart.batch(() => { chart.setData(visible(panels[p], low, high, stripes()), false); chart.setScale("x", { min: low, max: high }); chart.setScale("y", { min: null, max: null }); }));
    queueMicrotask(() => { busy = false; });
  };
  panels.forEach(() => { const box = document.createElement("div"); box.className = "chart"; place.append(box); });
  draw(dark.matches);
  dark.addEventListener("change", () => draw(dark.matches));
  window.addEventListener("beforeprint", () => draw(false));
  window.addEventListener("afterprint", () => draw(dark.matches));
  window.addEventListener("resize", () => { charts.forEach(chart => chart.setSize({ width: place.clientWidth, height: 220 })); });
  document.getElementById("all").addEventListener("click", () => show(whole[0], whole[1]));
  window.report = { charts, show, whole };
})();
