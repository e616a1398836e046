// Where a browser joins the lab: a student's laptop with a code of its phone, a teacher by a link.

import "./main.css";
import catalogue from "../words/join.json";
import { language, LANGUAGES, setLanguage, translator } from "../words/language";

type Key = keyof typeof catalogue;
const t = translator<Key>(catalogue);
const byId = <T extends HTMLElement>(id: string): T => document.getElementById(id) as T;
const form = byId<HTMLFormElement>("form"), code = byId<HTMLInputElement>("code"), said = byId("said"), other = byId("language");
const button = form.querySelector("button")!;

/** The token of a teacher's link: behind `#`, which browsers do not send, and out of the address at once. */
const token = new URLSearchParams(location.hash.slice(1)).get("t");
history.replaceState(null, "", location.pathname);

let problem: Key | null = null;

function show(): void {
  byId("title").textContent = t(token ? "teacher" : "title");
  byId("what").textContent = t(token ? "teacher.what" : "what");
  form.querySelector("label")!.textContent = t("code");
  button.textContent = t("join");
  other.textContent = LANGUAGES[language() === "en" ? "es" : "en"];
  form.hidden = token !== null;
  said.hidden = problem === null;
  said.textContent = problem ? t(problem) : "";
}

async function join(path: string, body: object): Promise<void> {
  button.disabled = true;
  try {
    const answer = await fetch(path, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body), cache: "no-store" });
    if (answer.ok) return location.replace("/lab/");
    problem = answer.status === 429 ? "slow" : answer.status === 403 ? (token ? "teacher.wrong" : "wrong") : "failed";
  } catch {
    problem = "unreachable";
  }
  button.disabled = false;
  show();
  code.select();
}

form.addEventListener("submit", (e) => {
  e.preventDefault();
  void join("/join/laptop", { code: code.value });
});
other.addEventListener("click", () => {
  setLanguage(language() === "en" ? "es" : "en");
  show();
});
show();
if (token) void join("/join/teacher", { token });
else code.focus();
