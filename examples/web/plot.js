// A small plot of curves over the last seconds. Curves differ by colour and by dashes.
const DASHES = [[], [7, 4], [2, 3], [9, 3, 2, 3]];
const SECONDS = 4;

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export class Plot {
  #rows = [];
  #names = [];
  constructor(canvas, key) {
    this.canvas = canvas;
    this.key = key;
  }
  /** Begins again with these curves. */
  begin(names) {
    this.#rows = [];
    this.#names = names;
    this.key.replaceChildren(...names.map((name, i) => {
      const entry = document.createElement("span");
      entry.innerHTML = `<svg viewBox="0 0 30 12" aria-hidden="true"><path d="M0 6h30" stroke="var(--curve-${i % 4})" stroke-width="3" stroke-dasharray="${DASHES[i % 4]}"/></svg>`;
      entry.append(name);
      return entry;
    }));
  }
  /** `values` of the curves at a time [s]. */
  add(time, values) {
    this.#rows.push({ time, values: Array.from(values) });
    while (this.#rows[0].time < time - SECONDS) this.#rows.shift();
  }
  draw() {
    const { canvas } = this, ratio = devicePixelRatio, width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (width === 0) return;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const context = canvas.getContext("2d");
    context.clearRect(0, 0, width, height);
    if (this.#rows.length < 2) return;
    const all = this.#rows.flatMap(({ values }) => values), least = Math.min(0, ...all), most = Math.max(1e-9, ...all);
    const end = this.#rows.at(-1).time, margin = 4 * ratio, range = most - least;
    const x = (time) => width * (1 - (end - time) / SECONDS), y = (value) => height - margin - (height - 2 * margin) * (value - least) / range;
    context.lineWidth = 2 * ratio;
    this.#names.forEach((_, i) => {
      context.strokeStyle = style(`--curve-${i % 4}`);
      context.setLineDash(DASHES[i % 4].map((length) => length * ratio));
      context.beginPath();
      for (const { time, values } of this.#rows) context.lineTo(x(time), y(values[i]));
      context.stroke();
    });
    context.fillStyle = style("--faint");
    context.font = `${11 * ratio}px system-ui, sans-serif`;
    context.textBaseline = "top";
    context.fillText(most.toPrecision(2).replace(/e\+?/, " · 10^"), margin, margin);
  }
}
