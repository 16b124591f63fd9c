// The hard cases in all forms of the equations, one table: node scenarios/hard/formulations.mjs [WORD], of the cases that contain WORD. Each
// is `cardan precision` with one method and one tolerance for all; long ones end early (`until`), so that the slowest form ends as well, and
// have their reference in double where 113 bits would take minutes (`double`).
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

const method = "dop853", tolerance = "1e-10", limit = 30; // [s] of processor time for each run
const forms = ["standard", "square_root", "diagonalised", "dense"];
const cases = [
  { of: "01_eccentric_orbit", kind: "position", until: 172800 },
  { of: "02_fast_rotor_on_a_slow_bus", kind: "attitude", until: 2, double: true },
  { of: "03_events_that_coincide", kind: "position" },
  { of: "04_rest_for_a_million_seconds", kind: "attitude", until: 1000, sets: ["mission.output.period=100"], double: true },
  { of: "05_stiff_joint", kind: "angle", until: 0.2, sets: ["mission.output.period=0.01"], double: true },
  { of: "06_past_a_gimbal_lock", kind: "angle" },
  { of: "07_smallest_numbers", kind: "angle" },
  { of: "08_half_a_start", kind: "angle", until: 5 },
  { of: "09_seven_decades", kind: "modes", until: 0.05, sets: ["mission.output.period=0.01"], double: true },
  { of: "10_fast_heavy_top", kind: "attitude", until: 1, double: true },
  { of: "11_light_cross_between_heavy_shafts", kind: "angle", until: 10 },
  { of: "12_chain_of_a_thousand", kind: "angle", until: 1, double: true },
  { of: "13_intermediate_axis", kind: "attitude", until: 1000, sets: ["mission.output.period=100"], double: true },
  { of: "14_ten_years_of_attitude", kind: "attitude", until: 864000, double: true },
  { of: "15_chaotic_double_pendulum", kind: "angle" },
  { of: "16_spinning_boom", kind: "modes", until: 2, double: true },
  { of: "17_babyboot", kind: "angle" },
  { of: "18_masses_that_differ_by_1e12", sets: ["masses=grow"], kind: "angle" },
  { of: "18_masses_that_differ_by_1e12", sets: ["masses=shrink"], kind: "angle" },
  { of: "18_masses_that_differ_by_1e12", sets: ["masses=alternate"], kind: "angle" },
];

const short = (x) => (x === undefined ? "no ledger" : x === 0 ? "0" : x.toExponential(1).replace("e+0", "").replace("e-0", "e-"));
const first = (text) => text.split("\n")[0];
const cardan = (...words) => spawnSync("build/cardan", words, { encoding: "utf8", maxBuffer: 1 << 26 });

/// Why the scene has no such form.
function reason(scene, form, sets) {
  if (form === "square_root") return "no hinge has one";
  const said = cardan("check", scene, "--set", `mission.dynamics=${form}`, ...sets).stderr;
  return said.match(/expected: dynamics that take (.*)/)?.[1] ?? first(said);
}

const word = process.argv[2] ?? "";
console.log(`${method} at ${tolerance}: largest error, residual of energy, evaluations of f\n`);
console.log(`| case | error of | reference | ${forms.join(" | ")} |`);
console.log(`|---|---|---|${"---|".repeat(forms.length)}`);
for (const one of cases) {
  const which = one.sets?.find((s) => !s.startsWith("mission."))?.split("=")[1];
  const name = which ? `${one.of}, ${which}` : one.of;
  if (!name.includes(word)) continue;
  const scene = join("scenarios/hard", one.of), out = mkdtempSync(join(tmpdir(), "formulations-"));
  const sets = (one.sets ?? []).flatMap((s) => ["--set", s]);
  console.error(name);
  const ran = cardan("precision", scene, "--formulations", "all", "--methods", method, "--tolerances", tolerance, "--limit", `${limit}`, "--repeat", "1",
    "--out", out, ...(one.double ? ["--reference", "dop853,cvode_adams"] : []), ...sets, ...(one.until ? ["--until", `${one.until}`] : []));
  const cells = [];
  if (ran.status === 0) {
    const study = JSON.parse(readFileSync(join(out, "precision.json"), "utf8"));
    const kind = study.kinds.find((k) => k.name === one.kind);
    const off = kind?.reference_off_by?.largest;
    cells.push(kind ? `${one.kind} [${kind.unit}]` : one.kind, `${study.reference.precision}${off === undefined ? "" : `, ${short(off)}`}`);
    for (const form of forms) {
      const row = study.rows.find((r) => r.formulation === form && r.method === method && r.relative === Number(tolerance));
      if (!row) cells.push(reason(scene, form, sets));
      else if (row.failure) cells.push(first(row.failure));
      else cells.push(`${short(row.errors[one.kind]?.largest)}, ${short(row.errors.energy?.largest)}, ${row.rhs_calls}`);
    }
  } else {
    cells.push(one.kind, first(ran.stderr));
  }
  console.log(`| ${name}${one.until ? `, ${one.until} s` : ""} | ${cells.join(" | ")} |`);
  rmSync(out, { recursive: true });
}
