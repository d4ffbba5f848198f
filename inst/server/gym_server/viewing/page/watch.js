// Follows one environment: requests new frames, and shows them.

import { number } from "./canvas.js";
import { drawChart } from "./chart.js";
import { Observation } from "./observation.js";
import { Playback } from "./playback.js";

const $ = (id) => document.getElementById(id);
// Opens the page instead of the token, if the server has one.
const KEY = new URLSearchParams(location.search).get("key");
// The page's own address, with its last slash even if it was requested without.
const HERE = new URL(location.pathname.replace(/\/?$/, "/"), location.href);
const GONE_PAUSE = 1000;
const PRESENCE_PAUSE = 700;
const STILL_AFTER = 1500;
// After these errors the environment is closed for good.
const CLOSED = new Set([
  "unknown_instance", "instance_idle_closed", "call_too_long", "environment_died",
]);

const observation = new Observation($("observation"));
const playback = new Playback(show);
let subEnv = 0;
let after = null;
let shown = null;
let request = null;
let wake = () => {};
let quiet = null;
let pace = null;

// Asking ------------------------------------------------------------------------------------

async function follow() {
  for (;;) {
    try {
      if (playback.wants && !document.hidden) {
        await askForFrame();
      } else {
        // Keep watching without requesting a frame.
        await ask("presence/");
        if (document.body.dataset.state === "gone") returnFromGone();
        await sleep(PRESENCE_PAUSE);
      }
    } catch (problem) {
      if (problem.name === "AbortError") continue;
      if (CLOSED.has(problem.code)) {
        await showClosed(problem);
        return;
      }
      if (problem.status === 401) {
        showLocked(problem);
        return;
      }
      if (problem.code === "invalid_parameter" && subEnv > 0) {
        setSubEnv(0);
        continue;
      }
      after = null;
      if (problem.status === 500 || problem.status === 429) showMessage("faulty", "This cannot be shown", problem.message);
      else showMessage("gone", "The server is gone", "This page continues when the server is back.");
      await sleep(GONE_PAUSE);
    }
  }
}

async function askForFrame() {
  const query = new URLSearchParams({ sub_env: subEnv });
  if (after !== null) query.set("after", after);
  const asked = subEnv;
  const frame = await ask(`state/?${query}`);
  if (asked !== subEnv || playback.paused) return;
  if (frame.state === "busy") {
    setState("busy", "busy: the picture must wait");
    return;
  }
  const isNew = frame.number !== after;
  after = frame.number;
  if (isNew) playback.arrive(frame);
}

async function ask(path) {
  request = new AbortController();
  const url = new URL(path, HERE);
  if (KEY !== null) url.searchParams.set("key", KEY);
  const answer = await fetch(url, { cache: "no-store", signal: request.signal });
  const content = await answer.json();
  if (!answer.ok) throw Object.assign(new Error(content.message), content, { status: answer.status });
  return content;
}

function sleep(milliseconds) {
  return new Promise((resolve) => {
    const timer = setTimeout(resolve, milliseconds);
    wake = () => {
      clearTimeout(timer);
      resolve();
    };
  });
}

function askAnew() {
  if (request) request.abort();
  wake();
}

// Showing -----------------------------------------------------------------------------------

async function show(frame) {
  shown = frame;
  hideMessage();
  $("env").textContent = frame.env_id;
  document.title = `${frame.env_id} · episode ${frame.episode}`;
  showSubEnvs(frame);
  $("episode").textContent = frame.episode ? number(frame.episode) : "–";
  $("step").textContent = frame.episode ? number(frame.step) : "–";
  $("return").textContent = frame.episode ? number(frame.return) : "–";
  showReturns(frame);
  showPace(frame);
  $("observation").hidden = !frame.observation;
  $("why").hidden = !frame.observation;
  $("scene").classList.toggle("observing", Boolean(frame.observation));
  $("picture").hidden = !frame.frame;
  if (frame.state === "not_reset") {
    showMessage("waiting", "Not reset yet", "It is shown when its first episode starts.");
    return;
  }
  setLive(frame);
  if (frame.observation) showObservation(frame);
  if (frame.frame) await showPicture(frame);
}

async function showPicture(frame) {
  const bytes = Uint8Array.from(atob(frame.frame), (letter) => letter.charCodeAt(0));
  const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
  // A later frame may have been decoded first.
  if (shown !== frame) return;
  const canvas = $("picture");
  if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) {
    canvas.width = bitmap.width;
    canvas.height = bitmap.height;
  }
  canvas.classList.toggle("coarse", bitmap.width * 2 < canvas.clientWidth);
  const pen = canvas.getContext("2d");
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.drawImage(bitmap, 0, 0);
  bitmap.close();
  const where = frame.num_envs === null ? "" : `, sub-environment ${frame.sub_env + 1}`;
  canvas.setAttribute(
    "aria-label", `${frame.env_id}${where}, episode ${frame.episode}, step ${frame.step}`
  );
}

function showObservation({ observation: seen, why_no_picture: why, hint }) {
  const shownOf =
    seen.size > seen.values.length
      ? `its observation, ${seen.values.length} of ${number(seen.size)} numbers`
      : "its observation";
  const advice = hint ? ` (${hint})` : "";
  $("why").textContent = `No picture: ${why}${advice}. Here is ${shownOf}.`;
  observation.draw(seen);
}

function showSubEnvs({ num_envs: numEnvs }) {
  $("sub_envs").hidden = numEnvs === null;
  if (numEnvs === null) return;
  $("sub_env").max = numEnvs;
  $("of").textContent = `of ${number(numEnvs)}`;
}

let charted = null;
function showReturns({ returns, num_envs: numEnvs, reward_threshold: goal }) {
  const key = returns.join();
  if (key === charted) return;
  charted = key;
  const whose = numEnvs === null ? "" : ` of all ${number(numEnvs)}`;
  const many = returns.length === 1 ? "the last episode" : `the last ${returns.length} episodes`;
  $("caption").textContent = `Returns of ${returns.length ? many : "the last episodes"}${whose}`;
  const mean = returns.map(Number).reduce((sum, value) => sum + value, 0) / returns.length;
  $("mean").textContent = returns.length ? `mean ${number(mean)}` : "";
  drawChart($("chart"), returns, goal);
}

// Steps are counted over all sub-environments; real time applies to each.
function showPace({ steps, fps, num_envs: numEnvs }) {
  const now = performance.now();
  if (!pace || steps < pace.steps) pace = { steps, now, rate: null };
  const seconds = (now - pace.now) / 1000;
  if (seconds > 1) pace = { steps, now, rate: (steps - pace.steps) / seconds };
  const [together, each] = numEnvs > 1 ? [`, all ${number(numEnvs)} together`, " each"] : ["", ""];
  const rate =
    pace.rate === null ? "" : `about ${number(Math.round(pace.rate))} steps a second${together}`;
  const real = fps === null ? "" : `real time (at most ${number(fps)}${each})`;
  $("pace").textContent = [rate, real].filter(Boolean).join(" · ");
}

// Messages ----------------------------------------------------------------------------------

function setState(state, words) {
  document.body.dataset.state = state;
  if ($("state").textContent !== words) $("state").textContent = words;
}

function setLive({ state }) {
  clearTimeout(quiet);
  if (playback.paused) return;
  setState("live", "live");
  const still = state === "ended" ? "episode ended" : "standing still";
  quiet = setTimeout(() => {
    if (document.body.dataset.state !== "live" || playback.paused) return;
    setState("still", still);
    $("pace").textContent = "Nobody is stepping it";
    pace = null;
  }, STILL_AFTER);
}

const BADGES = {
  waiting: "waiting for a reset",
  locked: "no key",
  faulty: "error",
  closed: "closed",
  gone: "server gone",
};

function showMessage(state, words, advice) {
  clearTimeout(quiet);
  setState(state, BADGES[state]);
  $("words").textContent = words;
  $("advice").textContent = advice;
  $("message").hidden = false;
  if (state !== "closed") $("others").replaceChildren();
}

function returnFromGone() {
  hideMessage();
  setState(playback.paused ? "paused" : "live", playback.paused ? "paused" : "live");
}

function hideMessage() {
  $("message").hidden = true;
}

function showLocked({ message }) {
  const advice =
    "In R, env_watch() or env$watch() makes a new link. It expires 10 minutes after its last use.";
  showMessage("locked", `${message}.`, advice);
  $("pause").disabled = true;
  if (!shown) $("env").textContent = "Locked";
}

async function showClosed(problem) {
  const byItsOwner = problem.code === "unknown_instance";
  showMessage("closed", byItsOwner ? "This environment is closed" : problem.message, "");
  $("pause").disabled = true;
  $("pace").textContent = "";
  if (!shown) $("env").textContent = "Closed";
  // The key is valid only for this environment.
  if (KEY !== null) return;
  for (;;) {
    try {
      const open = Object.entries((await ask("../../")).all_envs);
      const links = open.map(([id, name]) => {
        const link = Object.assign(document.createElement("a"), { textContent: `${name} (${id})` });
        link.href = new URL(`../../${encodeURIComponent(id)}/watch/`, HERE);
        const item = document.createElement("li");
        item.append(link);
        return item;
      });
      $("advice").textContent = open.length
        ? "Others on this server:"
        : "There are no others on this server.";
      if (links.length !== $("others").children.length || links.some((item, i) =>
        item.textContent !== $("others").children[i].textContent)) {
        $("others").replaceChildren(...links);
      }
    } catch {
      $("advice").textContent = "The server is gone, too.";
      $("others").replaceChildren();
    }
    await sleep(2 * GONE_PAUSE);
  }
}

// Controls ----------------------------------------------------------------------------------

function setPaused(paused) {
  playback.setPaused(paused);
  $("pause").setAttribute("aria-pressed", paused);
  $("pause").textContent = paused ? "Continue" : "Pause";
  clearTimeout(quiet);
  pace = null;
  if (document.body.dataset.state !== "gone") {
    setState(paused ? "paused" : "live", paused ? "paused" : "live");
  }
  askAnew();
}

function setSubEnv(number) {
  subEnv = number;
  after = null;
  $("sub_env").value = number + 1;
  observation.forget();
  playback.drop();
  askAnew();
}

$("pause").addEventListener("click", () => setPaused(!playback.paused));

$("speeds").addEventListener("change", (event) => {
  playback.setSlowness(Number(event.target.value));
  wake();
});

$("sub_env").addEventListener("change", () => {
  const wanted = Math.min(Math.max(1, Math.round(Number($("sub_env").value) || 1)), $("sub_env").max);
  setSubEnv(wanted - 1);
});

document.addEventListener("keydown", (event) => {
  const own = event.target.closest("button, a, input[type=number]");
  if (event.code !== "Space" || own || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  if (!$("pause").disabled) setPaused(!playback.paused);
});

document.addEventListener("visibilitychange", askAnew);

function redraw() {
  if (!shown) {
    drawChart($("chart"), [], null);
    return;
  }
  charted = null;
  showReturns(shown);
  if (shown.observation) observation.paint(shown.observation.names, shown.observation.values);
}
new ResizeObserver(redraw).observe($("chart"));
window.addEventListener("resize", redraw);
window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);

follow();
