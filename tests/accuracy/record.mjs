// docs/accuracy_record.md and its figure, out of what the tests of published cases report, the case files, the errors against the reference
// vectors, the scenarios and the measured table of hard models. `./dev accuracy` runs all of them and then this:
//   node tests/accuracy/record.mjs SOURCE REPORTS      REPORTS: a folder with *.json of gtest, oracle.txt, regress.json, sweeps.txt
import fs from "node:fs";
import path from "node:path";

const [source, reports] = process.argv.slice(2);
const read = (...parts) => fs.readFileSync(path.join(...parts), "utf8");

/// What is needed of tests/reference/cases/*.yaml, which are all written in one way: title, citation, numbers.
function caseFile(id) {
  const lines = read(source, "tests/reference/cases", id + ".yaml").split("\n");
  const scalar = (key) => {
    const at = lines.findIndex((line) => line.trimStart().startsWith(key + ":"));
    if (at < 0) return "";
    const indent = lines[at].length - lines[at].trimStart().length;
    let text = lines[at].slice(lines[at].indexOf(":") + 1).trim();
    for (let i = at + 1; i < lines.length && lines[i].trim() && lines[i].length - lines[i].trimStart().length > indent; ++i) text += " " + lines[i].trim();
    return text.replace(/^['"[]|['"\]]$/g, "").replace(/''/g, "'");
  };
  const numbers = [];
  lines.forEach((line, i) => {
    const quantity = line.match(/^\s*- quantity: (.*)$/), value = quantity && lines[i + 1].match(/^\s*value: (.*)$/);
    if (value) numbers.push([quantity[1].replace(/^['"]|['"]$/g, ""), value[1]]);
  });
  return { id, title: scalar("title"), citation: scalar("citation"), trust: scalar("trust"), numbers };
}

/// [{id, what, published, ours, difference, tolerance}] of the reports of gtest.
function comparisons() {
  const all = [];
  for (const file of fs.readdirSync(reports).filter((name) => name.endsWith(".gtest.json")))
    for (const suite of JSON.parse(read(reports, file)).testsuites)
      for (const test of suite.testsuite) {
        if (test.failures) throw new Error(`${test.classname}.${test.name} failed: no record of what does not hold`);
        for (const [key, value] of Object.entries(test)) {
          const [kind, id, what] = key.split("|");
          if (kind !== "accuracy" || !id) continue;
          const [published, ours, difference, tolerance] = String(value).split("|");
          const name = test.value_param || /\//.test(test.name) ? `${what} (${test.name.replace(/.*\//, "")})` : what;
          all.push({ id, what: name, published, ours, difference: Number(difference), tolerance: Number(tolerance) });
        }
      }
  return all;
}

const cut = (text, most) => (text.length > most ? text.slice(0, most - 1) + "…" : text);
const cell = (text) => String(text).replace(/\|/g, "\\|").replace(/</g, "&lt;");
const short = (x) => (x === 0 ? "0" : Number(x).toExponential(1).replace("e+", "e").replace(/e0$/, ""));
const numbersShort = (text) => {
  const all = text ? text.split(", ") : [];
  return all.length > 4 ? [...all.slice(0, 3), `… (${all.length})`].join(", ") : all.join(", ");
};
const percent = (x) => `${x >= 0.1 ? (100 * x).toFixed(0) : short(100 * x).replace("e0", "")} %`;
const share = (c) => (c.difference === 0 ? 0 : c.difference / c.tolerance); // also of what has to be exact
const row = (...cells) => `| ${cells.map(cell).join(" | ")} |`;

/// Difference over tolerance of each comparison, by case: dots on a logarithmic axis.
function figure(cases) {
  const left = 300, right = 820, top = 34, step = 17, height = top + step * cases.length + 46, low = -16, ink = "#22262b", muted = "#69717c", grid = "#e2e3e0";
  const x = (value) => left + ((Math.max(Math.log10(value || 1e-99), low) - low) / -low) * (right - left);
  const out = [`<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 860 ${height}" font-family="sans-serif" font-size="11">`,
               `<rect width="860" height="${height}" fill="#ffffff"/>`, `<text x="${left}" y="18" fill="${ink}" font-size="13">difference over tolerance, each comparison a dot</text>`];
  for (let n = low; n <= 0; n += 4)
    out.push(`<line x1="${x(10 ** n)}" x2="${x(10 ** n)}" y1="${top - 6}" y2="${height - 36}" stroke="${n ? grid : "#b53d2a"}"/>`,
             `<text x="${x(10 ** n)}" y="${height - 20}" fill="${muted}" text-anchor="middle">${n === low ? "≤ " : ""}1e${n}</text>`);
  cases.forEach(({ file, rows }, i) => {
    const y = top + step * i + 8;
    out.push(`<text x="${left - 14}" y="${y + 4}" fill="${ink}" text-anchor="end">${file.id}</text>`);
    for (const c of rows) out.push(`<circle cx="${x(share(c)).toFixed(1)}" cy="${y}" r="3" fill="#2f6db3" fill-opacity="0.55"/>`);
  });
  return out.join("\n") + "\n</svg>\n";
}

const all = comparisons();
const ids = fs.readdirSync(path.join(source, "tests/reference/cases")).filter((name) => name.endsWith(".yaml")).map((name) => name.slice(0, -5)).sort();
const cases = ids.map((id) => ({ file: caseFile(id), rows: all.filter((c) => c.id === id) }));
const missing = cases.filter(({ rows }) => !rows.length).map(({ file }) => file.id);
if (missing.length) throw new Error("cases of which no test tells what it reaches: " + missing.join(", "));

const out = [`# Accuracy record

Every published case in \`tests/reference/cases\` with its number, its source, what this program gives, the difference and the tolerance; then the reference vectors in extended precision, the scenarios, and
the hard models beside other libraries. Made by one command, which runs all of it anew:

\`\`\`
./dev accuracy
\`\`\`

The differences are those of ${read(reports, "sweeps.txt").trim()}; other instruction sets and compilers change the last bits. Where a difference is relative or absolute follows from its tolerance, which each case file gives with its reason
(\`tolerance_recommended\`). Of lists the largest difference of an entry stands here. A row without numbers is a law: nothing is published of what is conserved.

![difference over tolerance](accuracy_record.svg)

${all.length} comparisons in ${cases.length} cases, all within their tolerances; the largest share of a tolerance is ${(100 * Math.max(...all.map(share))).toFixed(0)} %.

| case | what | comparisons | worst share of its tolerance |
|---|---|---:|---:|
${cases.map(({ file, rows }) => row(`[${file.id}](#${file.id})`, file.title, rows.length, percent(Math.max(...rows.map(share))))).join("\n")}

## Published cases
`];
for (const { file, rows } of cases) {
  out.push(`### ${file.id}\n\n${file.title}. Source: ${file.citation.replace(/\s+/g, " ")}.\n`, "| what | published | ours | difference | tolerance |", "|---|---:|---:|---:|---:|",
           ...rows.map((c) => row(c.what, numbersShort(c.published), numbersShort(c.ours), short(c.difference), short(c.tolerance))));
  const others = file.numbers.filter(([quantity]) => /tool|own|recomputed|source|printed|solver|Abaqus|Ansys|program/i.test(quantity));
  if (others.length) out.push("\nNumbers of other programs in the same case:\n", "| quantity | number |", "|---|---:|", ...others.map(([quantity, value]) => row(quantity, cut(value.replace(/[[\]]/g, ""), 90))));
  out.push("");
}

const oracle = new Map();
for (const line of read(reports, "oracle.txt").trim().split("\n")) {
  const [name, field, error, limit] = line.split(" ");
  const seen = oracle.get(name) || { fields: 0, worst: 0, at: "" };
  const part = Number(error) / Number(limit);
  oracle.set(name, { fields: seen.fields + 1, worst: Math.max(seen.worst, part), at: part >= seen.worst ? `${field}: ${error} of ${limit}` : seen.at });
}
out.push(`## Reference vectors

${oracle.size} files with 32 digits (\`tests/reference/oracle/README.md\`), computed from first principles with 120 digits and no algorithm of ours; each field relative to its largest entry.

| vector | fields | worst field |
|---|---:|---|
${[...oracle].map(([name, o]) => row(name, o.fields, o.at)).join("\n")}
`);

const regress = JSON.parse(read(reports, "regress.json"));
if (regress.verdict !== "pass") throw new Error("a scenario fails: no record of what does not hold");
out.push(`## Scenarios

The scenarios of this repository against their golden files ([golden.md](golden.md)): of each the claim that used most of its limit.

| scenario | truth | claims | worst claim | of its limit |
|---|---|---:|---|---:|
${regress.scenarios.map((s) => {
  const worst = s.rows.filter((r) => r.worst && r.worst.share !== null).sort((a, b) => b.worst.share - a.worst.share)[0];
  return row(s.name, cut(s.truth.replace(/`/g, "").replace(/\s+/g, " ").trim(), 160), s.rows.length, worst ? `${worst.name}: ${short(worst.worst.difference)} ${worst.unit === "1" ? "" : worst.unit}` : "",
             worst ? percent(worst.worst.share) : "");
}).join("\n")}
`);

const benchmarks = read(source, "docs/benchmarks.md"), begin = benchmarks.indexOf("| model |", benchmarks.indexOf("### Errors of forward dynamics on hard models"));
out.push(`## Hard models beside other libraries

Relative error of v' (2-norm) against 113 bits, as measured by \`./dev figures\` ([benchmarks.md](benchmarks.md#errors-of-forward-dynamics-on-hard-models), which says how and with which versions).

${benchmarks.slice(begin, benchmarks.indexOf("\n\n", begin))}
`);

fs.writeFileSync(path.join(source, "docs/accuracy_record.svg"), figure(cases));
fs.writeFileSync(path.join(source, "docs/accuracy_record.md"), out.join("\n"));
console.log(`docs/accuracy_record.md: ${all.length} comparisons in ${cases.length} cases, ${oracle.size} vectors, ${regress.scenarios.length} scenarios`);
