"use strict";

/** All that went wrong, for the check of the page. */
const errors = [];
window.addEventListener("error", (event) => errors.push(event.message));
window.addEventListener("unhandledrejection", (event) => errors.push(String(event.reason)));
document.addEventListener("securitypolicyviolation", (event) => errors.push(`blocked: ${event.blockedURI}`));

const data = JSON.parse(document.getElementById("data").textContent);

/** The pixels of an image, as bytes of red, green, blue and alpha. */
function bytesOf(image) {
  const canvas = document.createElement("canvas");
  canvas.width = image.naturalWidth;
  canvas.height = image.naturalHeight;
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  return context.getImageData(0, 0, canvas.width, canvas.height).data;
}

/** Radiance, reason and level of a component at a pixel, from an atlas: see gallery.rs. */
function readPixel(bytes, side, component, x, y) {
  const above = 4 * (y * side * 4 + component * side + x);
  const below = above + 4 * side * side * 4;
  const [exponent, reason, level] = [bytes[below], bytes[below + 1], bytes[below + 2]];
  const value = (m) => (exponent === 0 ? 0 : ((m + 0.5) / 256) * 2 ** (exponent - 128));
  return { rgb: [0, 1, 2].map((i) => value(bytes[above + i])), reason, level: level - 1 };
}

/** The color of a radiance on a screen. */
function css(rgb) {
  const encode = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
  const bytes = rgb.map((v) => Math.round(255 * Math.min(1, Math.max(0, encode(2 * v)))));
  return `rgb(${bytes.join(",")})`;
}

function number(v) {
  return v === 0 ? "0" : v >= 100 ? v.toFixed(0) : v >= 0.001 ? v.toPrecision(3) : v.toExponential(1);
}

/** Two pictures with an edge between them, and a pixel of both. */
function viewer(element, scene) {
  const find = (selector) => element.querySelector(selector);
  const images = {};
  element.querySelectorAll("img[data-name]").forEach((image) => (images[image.dataset.name] = image));
  const atlases = {};
  element.querySelectorAll("img[data-atlas]").forEach((image) => (atlases[image.dataset.atlas] = bytesOf(image)));
  const names = Object.keys(images);
  const [left, right, slider, stage] = [".left", ".right", ".slider", ".stage"].map(find);
  const modes = names.filter((name) => name in atlases);
  left.value = modes[0];
  right.value = modes[modes.length - 1];
  const at = { x: Math.floor(scene.size * 0.48), y: Math.floor(scene.size * 0.87) };

  function draw() {
    // The left picture lies over the right one, and is cut off at the edge.
    for (const [canvas, name] of [[find(".over"), left.value], [find(".under"), right.value]]) {
      const context = canvas.getContext("2d");
      context.drawImage(images[name], 0, 0, canvas.width, canvas.height);
    }
    const percent = Number(slider.value);
    find(".over").style.clipPath = `inset(0 ${100 - percent}% 0 0)`;
    find(".edge").style.left = `${percent}%`;
    zoom();
  }

  function zoom() {
    const n = 17;
    const mark = find(".mark");
    mark.style.left = `${((at.x + 0.5) / scene.size) * 100}%`;
    mark.style.top = `${((at.y + 0.5) / scene.size) * 100}%`;
    for (const [selector, name] of [[".lens-left", left.value], [".lens-right", right.value]]) {
      const canvas = find(selector);
      const context = canvas.getContext("2d");
      const scale = canvas.width / n;
      context.imageSmoothingEnabled = false;
      context.clearRect(0, 0, canvas.width, canvas.height);
      const first = (n - 1) / 2;
      context.drawImage(images[name], at.x - first, at.y - first, n, n, 0, 0, canvas.width, canvas.height);
      for (const [color, grow] of [["#000", 1], ["#fff", 0]]) {
        context.strokeStyle = color;
        context.strokeRect(first * scale - grow, first * scale - grow, scale + 2 * grow, scale + 2 * grow);
      }
      canvas.nextElementSibling.textContent = name;
    }
    find(".where").textContent = `Pixel ${at.x}, ${at.y} of ${scene.size}\u00d7${scene.size}`
      + (scene.pixels === scene.size ? "" : `; components from the picture of ${scene.pixels}\u00d7${scene.pixels}`);
    find(".pixel").replaceChildren(table());
  }

  /** The components of the pixel in both modes. A difference tells of the mode that differs. */
  function table() {
    const shown = [left.value, right.value].map((name) => name.replace(/^difference /, ""));
    const [x, y] = [at.x, at.y].map((v) => Math.min(scene.pixels - 1, Math.floor((v * scene.pixels) / scene.size)));
    const table = document.createElement("table");
    const cell = (row, tag, text) => {
      const cell = document.createElement(tag);
      cell.textContent = text;
      row.append(cell);
      return cell;
    };
    const head = table.createTHead().insertRow();
    ["", ...shown].forEach((text) => cell(head, "th", text));
    data.layers.forEach((layer, component) => {
      const row = table.insertRow();
      cell(row, "th", layer);
      for (const mode of shown) {
        const pixel = readPixel(atlases[mode], scene.pixels, component, x, y);
        const td = cell(row, "td", pixel.rgb.map(number).join(", "));
        td.className = "number";
        const swatch = document.createElement("i");
        swatch.className = "swatch";
        swatch.style.background = css(pixel.rgb);
        td.prepend(swatch);
        const how = document.createElement("span");
        how.className = "how";
        const step = pixel.level > 0 ? `, step ${2 ** pixel.level}` : "";
        how.textContent = (scene.reasons[mode][pixel.reason] ?? `reason ${pixel.reason}`) + step;
        td.append(how);
      }
    });
    return table;
  }

  function move(event) {
    const box = stage.getBoundingClientRect();
    const on = (v, start, length) => Math.floor(((v - start) / length) * scene.size);
    go(on(event.clientX, box.left, box.width), on(event.clientY, box.top, box.height));
  }

  function go(x, y) {
    at.x = Math.min(scene.size - 1, Math.max(0, x));
    at.y = Math.min(scene.size - 1, Math.max(0, y));
    zoom();
  }

  let held = false;
  stage.addEventListener("pointermove", (event) => held || event.pointerType === "touch" || move(event));
  stage.addEventListener("click", (event) => {
    held = !held || event.pointerType === "touch";
    move(event);
  });
  stage.addEventListener("keydown", (event) => {
    const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const step = steps[event.key];
    if (step) {
      event.preventDefault();
      held = true;
      go(at.x + step[0], at.y + step[1]);
    }
  });
  slider.addEventListener("input", draw);
  [left, right].forEach((select) => select.addEventListener("change", draw));
  draw();
}

/** A table as text that spreadsheets take: tabs between cells, a cell that spans columns followed by empty ones. */
function asText(table) {
  const cells = (row) => [...row.cells].flatMap((c) => [c.textContent.trim(), ...Array(c.colSpan - 1).fill("")]);
  return [...table.rows].map((row) => cells(row).join("\t")).join("\n");
}

async function copy(button) {
  const text = asText(button.closest(".table").querySelector("table"));
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    // Pages from disk may not have the clipboard: select and copy as a user would.
    const area = document.createElement("textarea");
    area.value = text;
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
  button.textContent = "Copied";
  setTimeout(() => (button.textContent = "Copy table"), 1500);
}

/** The contrast of two colors, from 1 to 21: WCAG 2.2. */
function contrast(a, b) {
  const luminance = (color) => {
    const [r, g, b] = color.match(/[\d.]+/g).map((v) => v / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const [low, high] = [luminance(a), luminance(b)].sort((a, b) => a - b);
  return (high + 0.05) / (low + 0.05);
}

/**
 * Uses the page as a reader would, and tells the page around it what came of it: checks by name, the cells that tell of
 * a pixel, and whether the page is dark. The test of the report reads that.
 */
async function selfTest() {
  const checks = {};
  const pixels = {};
  for (const element of document.querySelectorAll(".viewer")) {
    const find = (selector) => element.querySelector(selector);
    const check = (name, holds) => (checks[`${element.dataset.scene}: ${name}`] = Boolean(holds));
    const fire = (target, type) => target.dispatchEvent(new Event(type));
    const stage = find(".stage").getBoundingClientRect();
    const point = (x, y) =>
      find(".stage").dispatchEvent(new PointerEvent("pointermove", {
        clientX: stage.left + x * stage.width, clientY: stage.top + y * stage.height, pointerType: "mouse",
      }));
    const shown = (canvas) => canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data.join();

    find(".slider").value = 25;
    fire(find(".slider"), "input");
    check("the slider cuts the left picture", find(".over").style.clipPath.includes("75%"));
    check("the slider moves the edge", find(".edge").style.left === "25%");
    check("the pictures are drawn", shown(find(".over")).replace(/0,0,0,255,?/g, "").length > 0);

    point(0.39, 0.51);
    const first = find(".pixel").textContent;
    const lens = shown(find(".lens-left"));
    const parts = (cell) => [...cell.childNodes].map((node) => node.textContent).filter((text) => text !== "");
    pixels[element.dataset.scene] = [...find(".pixel").querySelectorAll("tr")].map((row) => [...row.cells].map(parts));
    point(0.8, 0.9);
    check("another pixel has other values", find(".pixel").textContent !== first && shown(find(".lens-left")) !== lens);
    const where = find(".where").textContent;
    find(".stage").dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
    check("arrow keys move", find(".where").textContent !== where);

    const before = shown(find(".under"));
    const difference = [...find(".right").options].find((o) => o.value.startsWith("difference"));
    find(".right").value = difference.value;
    fire(find(".right"), "change");
    check("another picture can be chosen", shown(find(".under")) !== before);
  }
  for (const table of document.querySelectorAll(".table table")) {
    const lines = asText(table).split("\n").map((line) => line.split("\t").length);
    checks[`copies: ${table.caption.textContent}`] = lines.length > 3 && new Set(lines).size === 1;
  }
  const button = document.querySelector(".copy");
  await copy(button);
  checks["a table says that it was copied"] = button.textContent === "Copied";
  checks["nothing is wider than the screen"] = document.documentElement.scrollWidth <= window.innerWidth;
  checks["all pictures are there"] = [...document.images].every((image) => image.naturalWidth > 0);
  const color = (selector) => getComputedStyle(document.querySelector(selector)).color;
  const paper = getComputedStyle(document.body).backgroundColor;
  for (const selector of ["h1", "p", "td", "thead th", "a.card span", ".how", ".chart .tick"]) {
    const ink = selector.startsWith(".chart") ? getComputedStyle(document.querySelector(selector)).fill : color(selector);
    checks[`can be read: ${selector}`] = contrast(ink, paper) >= 4.5;
  }
  const requests = performance.getEntriesByType("resource").map((entry) => entry.name);
  checks["nothing is asked of the network"] = requests.every((name) => name.startsWith("data:"));
  const dark = contrast(paper, "rgb(0, 0, 0)") < contrast(paper, "rgb(255, 255, 255)");
  parent.postMessage(JSON.stringify({ checks, pixels, errors, dark, width: window.innerWidth }), "*");
}

window.addEventListener("load", () => {
  document.querySelectorAll(".viewer").forEach((element, i) => viewer(element, data.scenes[i]));
  document.querySelectorAll(".copy").forEach((button) => button.addEventListener("click", () => copy(button)));
  if (location.hash === "#selftest") selfTest();
});
