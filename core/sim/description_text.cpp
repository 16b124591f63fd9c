#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/sim/description.hpp"

namespace cardan {
namespace {

constexpr double kRoundOff = 1e-12;     // of the mass or largest inertia of the body: effective masses below are shown as zero
constexpr double kRoundedAway = 1e-14;  // of the size of the vehicle: what a few turns leave of nothing

std::string listed(const Json& names) { return fmt::format("{}", fmt::join(names.get<std::vector<std::string>>(), ", ")); }

/// How far the solutions of closed loops are from each other.
std::string forms_text(const Json& loops) {
  if (!loops.contains("forms")) return {};
  const Json& forms = loops["forms"];
  const std::string no_twin = forms["no_twin"].get<std::string>();
  std::string out = fmt::format("  differences at this state: v' from that of {}, multipliers and reactions from the first form\n",
                                no_twin.empty() ? "the dense twin" : "the first form (the dense twin: " + no_twin + ")");
  out += fmt::format("    {:<12} {:>10} {:>12} {:>10}\n", "", "v'", "multipliers", "reactions");
  const auto number = [](const Json& x) { return x.is_null() ? std::string("inf") : fmt::format("{:.1e}", x.get<double>()); };
  for (const Json& f : forms["all"])
    out += f.contains("refused") ? fmt::format("    {:<12} refused: {}\n", f["form"].get<std::string>(), f["refused"].get<std::string>())
                                 : fmt::format("    {:<12} {:>10} {:>12} {:>10}\n", f["form"].get<std::string>(), number(f["vdot"]),
                                               number(f["multipliers"]), number(f["reactions"]));
  return out;
}

/// What each loop would cost were it cut at another of its hinges: the cheapest and the dearest.
std::string cuts_text(const Json& loops) {
  if (!loops.contains("cuts")) return {};
  const Json& cuts = loops["cuts"];
  const double here = cuts["flops"].get<double>();
  std::string out = fmt::format("  cut where it is declared to close, each: {:.0f} operations inward, outward and in loops\n", here);
  for (const Json& loop : loops["all"]) {
    const Json *least = nullptr, *most = nullptr;
    int tried = 0;
    for (const Json& other : cuts["others"]) {
      if (other["loop"] != loop["name"]) continue;
      if (!least || other["flops"] < (*least)["flops"]) least = &other;
      if (!most || other["flops"] > (*most)["flops"]) most = &other;
      ++tried;
    }
    if (!least) continue;
    const auto one = [&](const Json& other) {
      return fmt::format("{:.0f} ({:+.1f} %) at the hinge of {}", other["flops"].get<double>(),
                         100.0 * (other["flops"].get<double>() / here - 1.0), other["hinge"].get<std::string>());
    };
    out += fmt::format("  {} cut elsewhere: {}{}{}\n", loop["name"].get<std::string>(), one(*least),
                       tried > 1 ? ", at most " + one(*most) : "", tried > 2 ? fmt::format(", of {}", tried) : "");
  }
  if (!cuts["all"].get<bool>()) out += "  more cuts than were counted\n";
  return out;
}

}  // namespace

std::string description_text(const Json& d) {
  std::string out = fmt::format("{}\n\nbodies: {} coordinates, {} velocities\n", d["vehicle"].get<std::string>(), d["n_q"].get<int>(),
                                d["n_v"].get<int>());
  for (const Json& b : d["bodies"]) {
    std::string notes;
    const auto note = [&](const std::string& text) { notes += (notes.empty() ? "" : "; ") + text; };
    if (!b["level"].is_null()) note(fmt::format("{} modes, level {}", b["modes"].get<int>(), b["level"].get<int>()));
    if (b["locked"].get<bool>()) note("locked");
    if (b["merged"].get<bool>()) note("merged with the body it is fixed to");
    if (!b["prescribed"].empty()) note("prescribed: " + listed(b["prescribed"]));
    if (b["factor"] != "cholesky") note("hinge in square-root form");
    out += fmt::format("  {:<17} {:<15} {:<13}  to {:<22}{:>2} dof  {}\n", b["name"].get<std::string>(), b["type"].get<std::string>(),
                       b["hinge"].get<std::string>(), b["to"].get<std::string>(), b["velocities"].size(), notes);
  }

  const Json& masses = d["masses"];
  // What is rounding beside the size of the vehicle is nothing.
  const auto triple = [](const Json& a, double size) {
    std::string numbers;
    for (const Json& x : a) numbers += fmt::format("{:>12.5g}", std::abs(x.get<double>()) > kRoundedAway * size ? x.get<double>() : 0.0);
    return numbers;
  };
  double inertia = 0.0, far = 0.0;  // [kg m^2, m]
  for (std::size_t k = 0; k < 3; ++k) inertia += masses["inertia_world_about_com"][k][k].get<double>();
  for (const Json& row : masses["bodies"])
    for (const Json& x : row["com_world"]) far = std::max(far, std::abs(x.get<double>()));
  const double total = masses["total"].get<double>(), gyration = total > 0.0 ? std::sqrt(inertia / total) : 0.0;
  far = std::max(far, gyration);
  out += fmt::format("\nmasses at the initial state, flexible bodies undeformed\n  {:<18}{:>12}{:>36}\n", "", "mass [kg]",
                     "mass centre, world axes [m]");
  for (const Json& row : masses["bodies"])
    out += fmt::format("  {:<18}{:>12.6g}{}\n", row["name"].get<std::string>(), row["mass"].get<double>(), triple(row["com_world"], far));
  out += fmt::format("  {:<18}{:>12.6g}{}\n", "total", masses["total"].get<double>(), triple(masses["com_world"], far));
  const char* title = "inertia about the mass centre, world axes [kg m^2]";
  for (const Json& row : masses["inertia_world_about_com"])
    out += fmt::format("  {:<52}{}\n", std::exchange(title, ""), triple(row, inertia));

  for (const Json& body : d["modes"]) {
    out += fmt::format("\nmodes of {}: {}\n  {:>4}{:>12}  {:<16}{:>54}  kept\n", body["body"].get<std::string>(),
                       body["source"].get<std::string>(), "", "[Hz]", "kind", "effective mass rx ry rz [kg m^2], x y z [kg]");
    int i = 0;
    std::array<double, 6> kept{};
    std::array<double, 2> none{};  // of inertias, of masses
    for (std::size_t k = 0; k < 6; ++k) none[k / 3] = std::max(none[k / 3], kRoundOff * body["rigid_mass"][k].get<double>());
    for (const Json& mode : body["audit"]) {
      std::string mass;
      for (std::size_t k = 0; k < 6; ++k) {
        const double x = mode["effective_mass"][k].get<double>();
        if (mode["kept"].get<bool>()) kept[k] += x;
        mass += fmt::format("{:>9.3g}", x > none[k / 3] ? x : 0.0);
      }
      out += fmt::format("  {:>4}{:>12.5g}  {:<16}{}  {}{}\n", ++i, mode["frequency_hz"].get<double>(), mode["kind"].get<std::string>(),
                         mass, mode["kept"].get<bool>() ? "yes" : "no",
                         mode["reason"].get<std::string>().empty() ? "" : ": " + mode["reason"].get<std::string>());
    }
    std::string shares;
    for (std::size_t k = 0; k < 6; ++k)
      shares += fmt::format(
          "{:>9.3g}", kept[k] > 1e-9 * body["rigid_mass"][k].get<double>() ? 100.0 * kept[k] / body["rigid_mass"][k].get<double>() : 0.0);
    if (i > 0) out += fmt::format("  {:<34}{}  kept, % of the whole body\n", "", shares);
  }

  if (const Json& system = d["system_modes"]; !system.is_null()) {
    out += "\nmodes of the whole about the initial state, at rest, without gravity and the preload of springs of hinges\n";
    if (system.contains("why_not")) out += "  not found: " + system["why_not"].get<std::string>() + "\n";
    int i = system.value("rigid", 0);
    if (i > 0) out += fmt::format("  1 ... {}: without stiffness\n", i);
    const auto part = [](const Json& p) {
      return fmt::format("{} {:.0f} %", p["name"].get<std::string>(), 100.0 * p["share"].get<double>());
    };
    if (!system.value("modes", Json::array()).empty())
      out += fmt::format("  {:>4}{:>12}{:>12}  {:<32}{}\n", "", "[Hz]", "damping [%]", "most of the motion", "most of the strain");
    for (const Json& mode : system.value("modes", Json::array()))
      out += fmt::format("  {:>4}{:>12.5g}{:>12.3g}  {:<32}{}\n", ++i, mode["frequency_hz"].get<double>(),
                         100.0 * mode["damping"].get<double>(), part(mode["kinetic"]), part(mode["strain"]));
  }

  const Json fields = d.value("fields", Json::array());
  if (!fields.empty()) out += "\nfields\n";
  for (const Json& f : fields) {
    std::string limits;
    for (const Json& l : f["limits"])
      limits += fmt::format("{}{}: {}", limits.empty() ? "; beyond " : ", ", l["name"].get<std::string>(), l["outside"].get<std::string>());
    out += fmt::format("  {:<17} {:<23} {}, read by {}{}\n", f["name"].get<std::string>(), f["type"].get<std::string>(),
                       f["quantity"].get<std::string>(), f["read_by"].empty() ? std::string("nobody") : listed(f["read_by"]), limits);
  }
  for (const Json& device : d.value("script_devices", Json::array()))
    if (device["in_step"].get<bool>())
      out += fmt::format("\n{}: in the right-hand side, {:.2g} us a call ({} so far)\n", device["type"].get<std::string>(),
                         device["us"].get<double>(), device["calls"].get<long>());
  const Json drawn = d.value("drawn", Json::array());
  if (!drawn.empty()) out += "\nparameters that chance sets anew with each seed but 0\n";
  for (const Json& p : drawn) {
    const std::string unit = p["unit"].get<std::string>();
    out += fmt::format("  {:<17} {:.6g}{}, {}\n", p["name"].get<std::string>(), p["value"].get<double>(), unit == "1" ? "" : " " + unit,
                       p["spread"].get<std::string>());
  }
  const Json sequences = d.value("sequences", Json::array());
  if (!sequences.empty()) out += "\nsequences (what each waits for next is known as it goes)\n";
  for (const Json& s : sequences) {
    const std::string first = s["waits_first_for"].get<std::string>();
    out += fmt::format("  {:<17} {}{}\n", s["name"].get<std::string>(),
                       s["starts"].get<bool>() ? "from the start of the run" : "when it is started",
                       first.empty() ? "" : ", waits first for " + first);
  }
  const Json devices = d.value("devices", Json::array());
  if (!devices.empty()) out += "\ndevices, in the order of evaluation\n";
  for (const Json& device : devices) {
    std::string about;
    for (const Json& mount : device["mounts"])
      about += fmt::format(", {} {}", mount["mount"].get<std::string>(), mount["at"].get<std::string>());
    for (const Json& given : device["parameters"])
      about += fmt::format(", {} {}", given["name"].get<std::string>(), given["value"].get<std::string>());
    for (const Json& in : device["inputs"]) about += fmt::format(", {} {}", in["name"].get<std::string>(), in["from"].get<std::string>());
    for (const Json& state : device["states"])
      about += fmt::format(", state {} (about {:.3g} {})", state["name"].get<std::string>(), state["nominal"].get<double>(),
                           state["unit"].get<std::string>());
    out += fmt::format("  {:<17} {}{}\n", device["name"].get<std::string>(), device["type"].get<std::string>(), about);
  }
  const Json faults = d.value("faults", Json::array());
  if (!faults.empty()) out += "\nfaults of ports\n";
  for (const Json& fault : faults)
    out += fmt::format("  {:<17} {}, from {:g} s{}\n", fault["port"].get<std::string>(), fault["fault"].get<std::string>(),
                       fault["from"].get<double>(), fault.contains("until") ? fmt::format(" to {:g} s", fault["until"].get<double>()) : "");

  const Json loops = d.value("loops", Json());
  if (!loops.is_null() && !loops["all"].empty()) {
    out += fmt::format("\nclosed loops, by {}\n", loops["embedded"].get<bool>() ? "embedding: inside of the sweeps"
                                                  : loops["form"] == "dae"      ? "multipliers of all bodies in absolute coordinates"
                                                                                : "multipliers over the open tree");
    for (const Json& l : loops["all"])
      out += fmt::format("  {:<17} {:<15} {}, {} rows on {} rates\n", l["name"].get<std::string>(), l["type"].get<std::string>(),
                         l["between"].get<std::string>(), l["rows"].get<int>(), l["rates"].get<int>());
    out += fmt::format(
        "  {} of {} rows are independent at the initial state (smallest scaled pivot {:.2g}, singular value {:.2g}); mobility {}, {} by "
        "counting rows\n",
        loops["rank"].get<int>(), loops["rows"].get<int>(), loops["smallest_pivot"].get<double>(), loops["from_singular"].get<double>(),
        loops["mobility"].get<int>(), loops["by_counting"].get<int>());
    for (const Json& set : loops["sets"]) {
      std::string names;
      for (const Json& name : set["loops"]) names += (names.empty() ? "" : ", ") + name.get<std::string>();
      const std::string why = set["why"].get<std::string>();
      out += fmt::format("  {}: by {}{}\n", names, set["form"].get<std::string>(), why.empty() ? "" : " (" + why + ")");
    }
    out += cuts_text(loops);
    out += forms_text(loops);
    for (const Json& x : loops["moved"])
      out += fmt::format("  moved to close them: {} from {:.6g} to {:.6g} {}\n", x["name"].get<std::string>(), x["given"].get<double>(),
                         x["found"].get<double>(), x["unit"].get<std::string>());
    for (const Json& row : loops["redundant"]) out += fmt::format("  implied by the others: {}\n", row.get<std::string>());
  }
  if (!loops.is_null() && !loops["open"].empty()) {
    out += "\nloops that are open until the mission closes them\n";
    for (const Json& l : loops["open"]) out += fmt::format("  {:<17} {}\n", l["name"].get<std::string>(), l["type"].get<std::string>());
  }

  out += fmt::format("\ngravity: {}\n\nprogram of sweeps, in order\n", d["gravity"].get<std::string>());
  std::string program = d["program"].get<std::string>();
  for (std::size_t from = 0, to; (to = program.find('\n', from)) != std::string::npos; from = to + 1)
    out += "  " + program.substr(from, to - from) + "\n";
  out += fmt::format("\nintegrator: {}\n", d["integrator"].get<std::string>());
  out += "\nnot modelled\n";
  for (const Json& item : d["not_modelled"]) out += "  " + item.get<std::string>() + "\n";
  const Json warnings = d.value("warnings", Json::array());
  if (!warnings.empty()) out += "\nwarnings\n";
  for (const Json& w : warnings)
    out += fmt::format("  {} {}: {}\n", w["code"].get<std::string>(), w["path"].get<std::string>(), w["about"].get<std::string>());
  out += d["defaults"].empty() ? "" : "\ndefaults used\n";
  for (const auto& [key, value] : d["defaults"].items()) out += fmt::format("  {} = {}\n", key, value.get<std::string>());
  return out;
}

}  // namespace cardan
