// How what is kept drifts over conservative hard cases, beside round-off theory: node scenarios/hard/drift.mjs [WORD], of the rows that contain
// WORD. Each is one `cardan run`; of the residuals of its ledger, relative, the largest so far is taken at a hundredth and a tenth of the
// run and at its end, and the slope of their logarithms over the last decade of time tells the law: 1/2 is a random walk of rounding
// errors (Brouwer 1937), 1 what each step loses in the same sense, 0 what only swings.
import { spawnSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

const rows = [
  { of: "01_eccentric_orbit", duration: 8640000, period: 8640, method: "dop853", relative: "1e-10" },
  { of: "01_eccentric_orbit", duration: 8640000, period: 8640, method: "dop853", relative: "1e-13" },
  { of: "05_stiff_joint", duration: 5, period: 0.005, method: "dop853", relative: "1e-10" },
  { of: "05_stiff_joint", duration: 5, period: 0.005, method: "dop853", relative: "1e-13" },
  { of: "13_intermediate_axis", duration: 10000, period: 10, method: "dop853", relative: "1e-10" },
  { of: "13_intermediate_axis", duration: 10000, period: 10, method: "dop853", relative: "1e-13" },
  { of: "13_intermediate_axis", duration: 10000, period: 10, method: "rk4", step: 0.01 },
  { of: "13_intermediate_axis", duration: 10000, period: 10, method: "rk4", step: 0.001 },
  { of: "13_intermediate_axis", duration: 10000, period: 10, method: "variational", step: 0.01 },
  { of: "15_chaotic_double_pendulum", duration: 1000, period: 1, method: "dop853", relative: "1e-13" },
  { of: "17_babyboot", duration: 1000, period: 1, method: "dop853", relative: "1e-13" },
];

/// Numbers of a channel with one column.
function numbers(file, path) {
  const out = join(mkdtempSync(join(tmpdir(), "drift-")), "numbers");
  spawnSync("h5dump", ["-d", path, "-b", "LE", "-o", out, file]);
  const bytes = readFileSync(out);
  rmSync(out);
  return new Float64Array(bytes.buffer, bytes.byteOffset, bytes.length / 8);
}
const short = (x) => (x === 0 ? "0" : x.toExponential(1).replace("e-0", "e-"));

const word = process.argv[2] ?? "";
console.log("| case | method | steps | quantity | a hundredth | a tenth | the end | of a step | exponent |");
console.log("|---|---|---:|---|---:|---:|---:|---:|---:|");
for (const row of rows) {
  const how = row.step ? `${row.method}, ${row.step} s` : `${row.method} ${row.relative}`;
  if (!`${row.of} ${how}`.includes(word)) continue;
  console.error(`${row.of} ${how}`);
  const out = mkdtempSync(join(tmpdir(), "drift-"));
  const sets = { duration: row.duration, "output.period": row.period, "integrator.method": row.method };
  if (row.step) sets["integrator.step"] = row.step;
  else sets["integrator.relative"] = row.relative;
  const run = spawnSync("build/cardan", ["run", join("scenarios/hard", row.of), "--quiet", "--out", out,
    ...Object.entries(sets).flatMap(([key, value]) => ["--set", `mission.${key}=${value}`])], { encoding: "utf8" });
  const file = join(out, "run.h5");
  if (!existsSync(file)) {
    console.log(`| ${row.of} | ${how} | ${run.stderr.split("\n")[0]} |`);
    continue;
  }
  const steps = JSON.parse(readFileSync(join(out, "summary.json"), "utf8")).steps;
  for (const quantity of ["energy", "angular_momentum"]) {
    const residual = numbers(file, `/channels/ledger/${quantity}`);
    const until = (part) => residual.slice(0, Math.round(part * (residual.length - 1)) + 1).reduce((most, x) => Math.max(most, Math.abs(x)), 0);
    const [hundredth, tenth, end] = [0.01, 0.1, 1].map(until);
    const slope = tenth > 0 && end > 0 ? Math.log10(end / tenth).toFixed(2) : "";
    console.log(`| ${row.of} | ${how} | ${steps} | ${quantity.replace("_", " ")} | ${short(hundredth)} | ${short(tenth)} | ${short(end)} | ${short(end / steps)} | ${slope} |`);
  }
  rmSync(out, { recursive: true });
}
