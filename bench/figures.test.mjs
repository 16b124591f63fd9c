// bench/figures.mjs on a page of its own: what is made anew, what stays.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "node:test";

const program = new URL("figures.mjs", import.meta.url).pathname;
const page = `# A page

<!-- figures: printf '| a |\\n|---|\\n| 1 |\\n' -->
old
<!-- end of figures -->

Between.

<!-- figures: echo half; exit 3 -->
kept
<!-- end of figures -->
After.
`;

const figures = (text, word = "") => {
  const file = join(mkdtempSync(join(tmpdir(), "figures-")), "page.md");
  writeFileSync(file, text);
  const run = spawnSync("node", [program, word, file], { encoding: "utf8" });
  return { status: run.status, said: run.stderr, text: readFileSync(file, "utf8") };
};

test("what a command prints takes the place of the old figures, what failed stays, and the exit code says so", () => {
  const { status, said, text } = figures(page);
  assert.equal(status, 1);
  assert.match(said, /ended with 3: its figures stay as they were/);
  assert.match(text, /-->\n\n`printf .*` \(.*commit .*\):\n\n\| a \|\n\|---\|\n\| 1 \|\n\n<!-- end of figures -->\n\nBetween\.\n/);
  assert.match(text, /exit 3 -->\nkept\n<!-- end of figures -->\nAfter\.\n$/);
});

test("made a second time the page has the same lines", () => {
  const once = figures(page, "printf").text;
  const twice = figures(once, "printf");
  assert.equal(twice.status, 0);
  assert.equal(twice.text, once);
});

test("a word that no command has changes nothing", () => {
  const { status, said, text } = figures(page, "loops");
  assert.equal(status, 2);
  assert.match(said, /no figures whose command contains "loops"/);
  assert.equal(text, page);
});

test("a mark without an end is named with its line", () => {
  const { status, said } = figures("a\n<!-- figures: true -->\n");
  assert.notEqual(status, 0);
  assert.match(said, /page.md:2: no <!-- end of figures --> after it/);
});
