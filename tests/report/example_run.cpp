#include "tests/report/example_run.hpp"

#include <algorithm>
#include <cmath>

#include "core/io/recorder.hpp"
#include "core/io/sha256.hpp"
#include "core/io/summary.hpp"

namespace cardan {
namespace {

constexpr double kEnd = 240.0;     // [s]
constexpr double kAngle = 0.5236;  // [rad] of the slew

std::vector<std::string> numbered(const std::string& name, int n) {
  std::vector<std::string> out;
  for (int i = 1; i <= n; ++i) out.push_back(name + std::to_string(i));
  return out;
}

const std::vector<Channel> kChannels = {
    {"bodies/bus/attitude", {"w", "x", "y", "z"}, "-", "world", "orientation of the bus, quaternion bus into world"},
    {"bodies/bus/rate", {"x", "y", "z"}, "rad/s", "body bus", "angular velocity of the bus"},
    {"bodies/bus/pose", {"angle", "distance"}, "rad m", "", "one unit for each component"},
    {"wheels/speed", numbered("wheel_", 4), "rad/s", "", "speed about the spin axis"},
    {"wheels/torque", numbered("wheel_", 4), "N m", "", "motor torque"},
    {"hinges/angle", {"wing_left", "wing_right"}, "rad", "", "drive angles"},
    {"modes/wing_left", numbered("mode_", 6), "m", "", "modal amplitudes"},
    {"modes/wing_right", numbered("mode_", 6), "m", "", "modal amplitudes"},
    {"ledger/residuals", {"linear_momentum", "angular_momentum", "energy"}, "-", "", "balance error over largest sum"},
    {"pointing/error", {"roll", "pitch", "yaw"}, "deg", "body bus", "attitude error"},
    {"control/torque", {"x", "y", "z"}, "N m", "body bus", "commanded torque"},
    {"extra", {"constant", "</script>"}, "1", "", "a <b>name</b> & a text that must not be read as markup"},
};

std::vector<double> signals(double t, int i) {
  const double s = std::clamp(t / 90.0, 0.0, 1.0);
  const double angle = kAngle * s * s * s * (10 - 15 * s + 6 * s * s), ring = std::exp(-0.02 * t) * std::sin(0.9 * t);
  const double rate = kAngle / 90.0 * 30 * s * s * (1 - s) * (1 - s);
  const double torque = (s < 1 ? 0.9 * std::sin(2 * M_PI * s) : 0.0) + 0.05 * ring;
  std::vector<double> v{std::cos(angle / 2), 0.27 * std::sin(angle / 2), 0.53 * std::sin(angle / 2), 0.8 * std::sin(angle / 2)};
  for (double c : {0.27, 0.53, 0.8}) v.push_back(c * rate + 2e-4 * ring * c);
  v.insert(v.end(), {angle, 7e6 + std::sin(0.1 * t)});
  for (int k = 0; k < 4; ++k) v.push_back(150 + 40 * k + (k % 2 ? -1 : 1) * 9e3 * rate);
  for (int k = 0; k < 4; ++k) v.push_back((k % 2 ? -0.4 : 0.4) * torque * (1 + 0.1 * k));
  v.insert(v.end(), {0.004 * t, -0.004 * t});
  for (int wing = 0; wing < 2; ++wing)
    for (int k = 1; k <= 6; ++k) v.push_back((wing ? -1 : 1) * 0.02 / k * std::exp(-0.01 * k * t) * std::sin(0.9 * k * t + wing));
  for (double c : {1e-15, 3e-14, 4e-12}) v.push_back(c * (1 + std::sin(12.9898 * i)) * (1 + t / 30));
  for (double c : {0.27, 0.53, 0.8}) v.push_back((kAngle - angle) * c * 57.3 * (s < 1) + 0.01 * ring);
  for (double c : {0.27, 0.53, 0.8}) v.push_back(c * torque);
  v.insert(v.end(), {1.0, 0.5 * std::cos(0.05 * t)});
  return v;
}

}  // namespace

void write_example_run(const std::string& path, int rows, bool finished) {
  RunHeader h;
  h.scenario = "example/scenario.lua";
  h.title = "Slew of 30 degrees with flexible wings <example>";
  h.program_version = "0.1.0";
  h.commit = "0123456";
  h.compiler = "gcc 12.2.0";
  h.flags = "-O3 -DNDEBUG -ffp-contract=off";
  h.seed = 42;
  h.integrator = "cvode_adams, relative tolerance 1e-9";
  h.inputs = {{"scenario.lua", sha256("a"), ""}, {"vehicle.yaml", sha256("b"), "bodies:\n  bus:\n    mass: 1840 kg  # </script> <b>\n"}};
  h.effective_parameters = {{"bodies.bus.mass", "1840 kg"}, {"bodies.bus.inertia", "[2100, 1900, 2400] kg m^2"}};
  h.defaults_used = {{"gravity.gradient", "false"}};
  h.sweep_program =
      "position      base_to_tip   7 bodies\ninertia       tip_to_base   7 bodies\nacceleration  base_to_tip   7 "
      "bodies\n";
  // A strip of 2 x 5 points whose tip goes up, and five points without lines.
  ModePicture strip{{"wing_left", "wing_right"}, "plate 4 x 1 m", {0.31, 1.9}, {}, {}, {}}, dots{{"boom"}, "", {2.5}, {}, {}, {}};
  for (int i = 0; i < 5; ++i)
    for (int j = 0; j < 2; ++j) {
      strip.points.insert(strip.points.end(), {1.0 * i, 1.0 * j, 0.0});
      if (i > 0) strip.lines.insert(strip.lines.end(), {2 * i + j - 2, 2 * i + j});
      if (j > 0) strip.lines.insert(strip.lines.end(), {2 * i, 2 * i + 1});
    }
  for (int mode = 1; mode <= 2; ++mode)
    for (int i = 0; i < 10; ++i) strip.shapes.insert(strip.shapes.end(), {0.0, 0.0, std::sin(0.4 * mode * (i / 2))});
  for (int i = 0; i < 5; ++i) {
    dots.points.insert(dots.points.end(), {0.0, 0.5 * i, 0.0});
    dots.shapes.insert(dots.shapes.end(), {0.01 * i * i, 0.0, 0.0});
  }
  h.mode_pictures = {strip, dots};
  const auto recorder = make_hdf5_recorder(path);
  recorder->begin(h, kChannels);
  recorder->note(Note::printed, NAN, {"a line of the script <b>", "the scenario"});
  recorder->note(Note::phase, 0.0, {"slew"});
  bool settles = false, half = false;
  for (int i = 0; i < rows; ++i) {
    const double t = rows > 1 ? kEnd * i / (rows - 1) : 0.0;
    if (t >= 45.0 && !half) {
      half = true;
      recorder->note(Note::event, 45.0, {"half way", "rising"});
      recorder->note(Note::warning, 45.0,
                     {"W0301", "eta 1 reaches 0.3 m, 5 % of its length <b>", "bodies.wing_left", "vehicle.yaml:12", "level: 2"});
    }
    if (t >= 90.0 && !settles) {
      settles = true;
      recorder->note(Note::phase, 90.0, {"settle"});
      recorder->note(Note::printed, 90.0, {"settling", "phase \"settle\""});
    }
    recorder->row(t, signals(t, i));
    StepInterval interval;
    interval.begin = rows > 1 ? t - kEnd / (rows - 1) : 0.0, interval.end = t;
    interval.steps = 10, interval.evaluations = 70, interval.by_error = 9, interval.orders = 50 + i % 7,
    interval.rejected.by_error[1] = i % 3;
    interval.shortest = 2e-3, interval.longest = 0.01 * (1 + i % 5), interval.worst = "wing_left.mode 3", interval.of_worst = 6;
    note(*recorder, interval);
  }
  if (finished) {
    Summary s;
    s.scenario = h.scenario;
    s.checks = {{"pointing error at the end", 0.0031, 0.01, true, "deg", "largest axis, after 200 s", -HUGE_VAL, 0.01},
                {"jitter", 1.8, 2.0, true, "arcsec", "standard deviation over the last 30 s", -HUGE_VAL, 2.0},
                {"energy balance", 3.2e-12, 1e-9, true, "-", "", -HUGE_VAL, 1e-9}};
    s.ledger = Ledger{1.1e-15, 3.4e-14, 3.2e-12, 1e-12, 1e-12, 1e-12, false};
    s.warnings.add(Code::beyond_the_model, {"bodies.wing_left", {"vehicle.yaml", 12, 5}}, "eta 1 reaches 0.3 m, 5 % of its length <b>",
                   "level: 2", 31.25);
    s.warnings.add(Code::mission_doubt, {}, "the mission ends before its last phase");
    s.simulated_s = s.planned_s = kEnd;
    s.ended_by = "the planned end";
    s.wall_s = 3.418;
    s.steps = 48218;
    s.rhs_calls = 91830;
    s.integration.by_error = 48000, s.integration.by_stop = 211, s.integration.rejected.by_error[1] = 17;
    s.integration.restarts = {1, 2400, 1, 0, 0, 10, 0};
    s.worst = {{"wing_left.mode 3", 40000}, {"bus.<b>wx</b>", 8000}};
    s.figures = {{"thr_a error", 0.0031, "deg"}, {"settling_time", 131.4, "s"}, {"jitter", 1.8, "arcsec"}};
    s.model = {7, 7, 32, 31, 12};
    s.versions = {{"cardan", "0.1.0"}, {"SUNDIALS", "6.4.1"}, {"HDF5", "1.10.8"}};
    recorder->attach("summary", to_json(s));
    recorder->close();
  } else {
    recorder->flush();
  }
}

}  // namespace cardan
