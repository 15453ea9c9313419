// The slides: the current one, playback of an action by a click, tap, space or enter, and the ribbon.
"use strict";

const root = document.documentElement;
const find = (selector, within = document) => within.querySelector(selector);
const plan = window.PLAN;
const moments = plan.view.time;
const bounds = [0, ...plan.view.ends.map((end) => moments[end])];
const duration = bounds[bounds.length - 1];
const QUICK = window.matchMedia("(prefers-reduced-motion: reduce)").matches ? 0 : 0.6;

root.classList.add("live");
const stage = makeStage(plan.view);
root.classList.toggle("webgl", stage !== null);

const player = {
  time: 0,
  playing: null, // { from, to, begun } while it plays
  get slide() {
    return Reveal.getCurrentSlide();
  },
  get action() {
    return actionOf(this.slide);
  },
};
window.player = player;
player.stage = stage;

// The number of the action of a slide, -1 on the first and the number of actions on the last one.
function actionOf({ dataset: { action, end } }) {
  return action === undefined ? (end === "1" ? plan.actions.length : -1) : Number(action);
}

// The view of an action.
const shotOf = (number) => Math.min(Math.max(number + 1, 0), plan.actions.length);

// The interval that a slide plays, and the moment that it shows: [from, to, rest] in seconds.
function span(number = player.action) {
  if (number < 0) return [0, duration, 0];
  if (number >= plan.actions.length) return [0, duration, duration];
  return [bounds[number], bounds[number + 1], bounds[number + 1]];
}

function show(time) {
  player.time = time;
  if (stage) stage.setTime(time);
  find(".now").style.left = `${(100 * time) / duration}%`;
  find(".ribbon").setAttribute("aria-valuenow", time.toFixed(1));
  const current = bounds.findIndex((bound, number) => number && time <= bound + 1e-9) - 1;
  const marked = player.action < 0 && !player.playing ? -1 : Math.max(current, 0);
  document.querySelectorAll(".steps i").forEach((step, number) => step.classList.toggle("current", number === marked));
  document.querySelectorAll(".reba").forEach((box, number) => {
    const run = plan.people[number].find((one) => time <= one.end + 1e-9);
    if (!run) return;
    find("b", box).textContent = run.score;
    find(".risk", box).textContent = `${run.risk} risk`;
    box.style.borderLeftColor = run.colour;
  });
}

player.play = (from = span()[0]) => {
  const [, to] = span();
  const film = find("figure", player.slide).dataset.film;
  if (!stage && !film) return Reveal.next();
  player.playing = { from, to, begun: performance.now() };
  root.classList.add("playing");
  if (!stage) {
    // A new address restarts the film.
    find(".still", player.slide).src = `${film}?${Math.round(player.playing.begun)}`;
  }
  requestAnimationFrame(step);
};

player.stop = () => {
  player.playing = null;
  root.classList.remove("playing");
  const { still } = find("figure", player.slide).dataset;
  if (!stage && still) find(".still", player.slide).src = still;
};

function step(now) {
  if (!player.playing) return;
  const { from, to, begun } = player.playing;
  const time = Math.min(from + Math.max(now - begun, 0) / 1000, to);
  show(time);
  if (time < to) {
    requestAnimationFrame(step);
    return;
  }
  player.stop();
  const word = find(".play .word", player.slide);
  word.textContent = word.textContent.replace(/^Play/, "Play again:").replace(/:$/, "").replace(": all", "");
}

function changed() {
  player.stop();
  const figure = find("figure", player.slide);
  if (stage) {
    figure.prepend(stage.canvas);
    stage.canvas.setAttribute("aria-label", find("h1, h2", player.slide).textContent);
    stage.fit(figure);
    const shot = shotOf(player.action);
    if (player.shown !== undefined && shot !== player.shown) {
      stage.aim(player.shown);
      stage.aim(shot, QUICK);
    } else {
      stage.aim(shot);
    }
    player.shown = shot;
    const doing = plan.actions[player.action];
    stage.mark(doing ? doing.frame : null, doing && doing.radius);
  }
  find(".previous").disabled = Reveal.isFirstSlide();
  find(".next").disabled = Reveal.isLastSlide();
  show(span()[2]);
}

// On paper every slide has a picture; on the screen one scene moves from slide to slide. Pictures of slides that were not
// shown yet would not be there in time.
if (!stage) document.querySelectorAll(".still").forEach((picture) => (picture.loading = "eager"));
window.addEventListener("beforeprint", () => {
  if (!stage) return;
  document.querySelectorAll(".slides > section").forEach((slide) => {
    const number = actionOf(slide);
    const picture = stage.picture(shotOf(number), span(number)[2], plan.actions[number]);
    picture.className = "paper";
    find("figure", slide).append(picture);
  });
  stage.fit(find("figure", player.slide));
  changed();
});
window.addEventListener("afterprint", () => document.querySelectorAll(".paper").forEach((picture) => picture.remove()));

// The end of a drag that turns the view is not a click.
let pressed = null;
document.addEventListener("pointerdown", (event) => (pressed = [event.clientX, event.clientY, event.timeStamp]));
document.addEventListener("click", (event) => {
  if (!event.target.closest("figure")) return;
  const moved = pressed && event.detail ? Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) : 0;
  if (moved < 8) player.play();
});
find(".previous").addEventListener("click", () => Reveal.prev());
find(".next").addEventListener("click", () => Reveal.next());

// A click on the ribbon shows that moment, on its slide.
function seek(event) {
  const box = find(".ribbon").getBoundingClientRect();
  const time = duration * Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
  const number = Math.max(bounds.findIndex((bound, at) => at && time <= bound), 1);
  if (player.action !== number - 1) Reveal.slide(number);
  player.stop();
  show(time);
}
find(".ribbon").addEventListener("pointerdown", (event) => {
  find(".ribbon").setPointerCapture(event.pointerId);
  seek(event);
});
find(".ribbon").addEventListener("pointermove", (event) => event.buttons && seek(event));

const onKey = () => {
  const focused = document.activeElement;
  if (!focused || !focused.closest("button, a")) player.play();
  else focused.click();
};
Reveal.initialize({
  disableLayout: true,
  display: "grid",
  controls: false,
  progress: false,
  hash: true,
  transition: "none",
  backgroundTransition: "none",
  center: false,
  overview: false,
  help: false,
  scrollActivationWidth: null,
  viewDistance: 2,
  keyboard: { 13: onKey, 32: onKey },
}).then(() => {
  Reveal.on("slidechanged", changed);
  window.addEventListener("resize", () => stage && stage.fit(find("figure", player.slide)));
  changed();
  root.dataset.ready = "1";
});
