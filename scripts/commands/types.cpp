// `cardan types`: the types of bodies, hinges, hinge loads, devices and fields, from their own tables, those of plugins as well.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "bodies/register.hpp"
#include "core/abi/registry.hpp"
#include "core/base/units.hpp"
#include "core/io/json.hpp"
#include "core/model/device_units.hpp"
#include "core/model/fields.hpp"
#include "core/model/hinge_load_types.hpp"
#include "core/model/initial.hpp"
#include "core/model/params.hpp"
#include "hinges/register.hpp"
#include "plugins/devices/register.hpp"
#include "scripts/commands/commands.hpp"

namespace cardan {
namespace {

std::string kind_of(const cardan_param_desc& p) {
  const auto names = [&] { return fmt::format("{}", fmt::join(p.names, p.names + p.count, ", ")); };
  switch (p.kind) {
    case CARDAN_NUMBER:
      return "number";
    case CARDAN_INTEGER:
      return "whole number";
    case CARDAN_TRUTH:
      return "true or false";
    case CARDAN_TEXT:
      return "text";
    case CARDAN_CHOICE:
      return "one of " + names();
    case CARDAN_FILE:
      return "file";
    case CARDAN_TABLE:
      return fmt::format("rows of {}, or a CSV file", names());
    case CARDAN_VECTOR:
      return p.flags & CARDAN_EACH ? "vector of 3, or one number for all" : "vector of 3";
    case CARDAN_UNIT_VECTOR:
      return "axis, 3 numbers of any length";
    default:
      break;
  }
  const char* what = p.kind == CARDAN_UNIT_VECTORS ? "axes" : "vectors";
  return p.count > 0 ? fmt::format("list of {} {}", p.count, what) : fmt::format("list of {}", what);
}

/// Of a device "N m|N": where it is mounted at a component that turns, or slides.
std::string unit_of(std::string unit) {
  if (unit == "1" || unit.empty()) return "";
  if (const auto bar = unit.find('|'); bar != std::string::npos) unit.replace(bar, 1, " or ");
  return fmt::format(" [{}]", unit);
}

std::string default_of(const cardan_param_desc& p) {
  if (p.flags & CARDAN_REQUIRED) return "required";
  if (p.kind == CARDAN_NUMBER || p.kind == CARDAN_INTEGER) return fmt::format("default {:g}", p.fallback[0]);
  if (p.kind == CARDAN_TRUTH) return p.fallback[0] != 0.0 ? "default true" : "default false";
  if (p.kind == CARDAN_CHOICE && p.fallback[0] >= 0.0 && p.fallback[0] < p.count)
    return fmt::format("default {}", p.names[static_cast<std::size_t>(p.fallback[0])]);
  if (p.kind == CARDAN_VECTOR || p.kind == CARDAN_UNIT_VECTOR)
    return fmt::format("default [{:g}, {:g}, {:g}]", p.fallback[0], p.fallback[1], p.fallback[2]);
  return "optional";
}

Json parameters(const cardan_param_desc* params, std::uint32_t n) {
  Json all = Json::array();
  for (std::uint32_t i = 0; i < n; ++i) {
    const cardan_param_desc& p = params[i];
    all.push_back({{"name", p.name},
                   {"kind", kind_of(p)},
                   {"unit", p.unit ? p.unit : ""},
                   {"range", range_text(p)},
                   {"default", default_of(p)},
                   {"meaning", p.meaning ? p.meaning : ""}});
  }
  return all;
}

Json components(const char* const* names, const char* const* units, std::uint32_t n) {
  Json all = Json::array();
  for (std::uint32_t i = 0; i < n; ++i) all.push_back({{"name", names[i]}, {"unit", units[i]}});
  return all;
}

/// What `initial` also takes as one list.
Json groups(const std::vector<ComponentGroup>& all, const char* const* names) {
  Json out = Json::array();
  for (const ComponentGroup& g : all)
    out.push_back(
        {{"names", g.names}, {"unit", g.unit}, {"components", std::vector<std::string>(names + g.first, names + g.first + g.size)}});
  return out;
}

Json to_json(const Families<cardan_hinge_family>::Entry& e) {
  const cardan_hinge_family& f = *e.family;
  return {{"type", f.type},
          {"summary", f.summary},
          {"origin", e.origin},
          {"parameters", parameters(f.params, f.n_params)},
          {"coordinates", components(f.q_names, f.q_units, f.nq)},
          {"velocities", components(f.v_names, f.v_units, f.nv)},
          {"coordinate_groups", groups(coordinate_groups(f), f.q_names)},
          {"velocity_groups", groups(velocity_groups(f), f.v_names)}};
}

std::string default_of(const HingeLoadParameter& p) {
  if (std::isnan(p.fallback)) return "required";
  if (std::isinf(p.fallback)) return "optional";
  if (!p.times) return fmt::format("default {:g}", p.fallback);
  return p.fallback == 1.0 ? fmt::format("default `{}`", p.times) : fmt::format("default {:g} `{}`", p.fallback, p.times);
}

Json to_json(const HingeLoadType& type) {
  Json parameters = Json::array();
  for (const HingeLoadParameter& p : type.parameters) {
    const bool same = std::string_view(p.turns) == p.slides;
    parameters.push_back({{"name", p.name},
                          {"kind", "number"},
                          {"unit", same ? p.turns : fmt::format("{} or {}", p.turns, p.slides)},
                          {"range", ""},
                          {"default", default_of(p)},
                          {"meaning", p.meaning}});
  }
  return {{"type", type.name}, {"summary", type.summary}, {"parameters", parameters}};
}

/// The keys that say where its mass comes from.
std::vector<std::string> keys_of(const cardan_body_family& f) {
  switch (f.mass_source) {
    case CARDAN_MASS_RIGID:
      return {"mass", "com", "inertia", "nodes"};
    case CARDAN_MASS_POINT:
      return {"mass", "com", "nodes"};
    case CARDAN_MASS_MODES:
      return {"modal", "level", "rotary_inertia", "initial"};
    default:
      return {"nodes"};
  }
}

Json to_json(const Families<cardan_body_family>::Entry& e) {
  const cardan_body_family& f = *e.family;
  return {{"type", f.type},
          {"summary", f.summary},
          {"origin", e.origin},
          {"keys", keys_of(f)},
          {"parameters", parameters(f.params, f.n_params)}};
}

Json to_json(const Families<cardan_device_family>::Entry& e) {
  const cardan_device_family& f = *e.family;
  Json mounts = Json::array(), inputs = Json::array(), outputs = Json::array(), states = Json::array();
  for (std::uint32_t i = 0; i < f.n_mounts; ++i)
    mounts.push_back({{"name", f.mounts[i].name},
                      {"kind", f.mounts[i].kind == CARDAN_MOUNT_NODE    ? "node"
                               : f.mounts[i].kind == CARDAN_MOUNT_MASS  ? "rigid body, whose mass it is a part of"
                               : f.mounts[i].kind == CARDAN_MOUNT_FIELD ? "field"
                                                                        : "component of a hinge"},
                      {"meaning", f.mounts[i].meaning}});
  for (std::uint32_t i = 0; i < f.n_ports; ++i)
    (f.ports[i].kind == CARDAN_PORT_IN ? inputs : outputs)
        .push_back({{"name", f.ports[i].name},
                    {"unit", f.ports[i].unit},
                    {"meaning", f.ports[i].meaning},
                    {"frame", f.ports[i].frame ? Json(f.ports[i].frame) : Json()},
                    {"required", (f.ports[i].flags & CARDAN_PORT_REQUIRED) != 0}});
  for (const auto& [all, n] : {std::pair(f.states, f.n_states), std::pair(f.marks, f.n_marks)})
    for (std::uint32_t i = 0; i < n; ++i) states.push_back({{"name", all[i].name}, {"unit", all[i].unit}, {"meaning", all[i].meaning}});
  return {{"type", f.type},
          {"role", role_text(f)},
          {"summary", f.summary},
          {"origin", e.origin},
          {"parameters", parameters(f.params, f.n_params)},
          {"mounts", mounts},
          {"inputs", inputs},
          {"outputs", outputs},
          {"states", states}};
}

Json to_json(const Families<cardan_field_family>::Entry& e) {
  const cardan_field_family& f = *e.family;
  Json limits = Json::array();
  for (std::uint32_t i = 0; i < f.n_limits; ++i)
    limits.push_back({{"name", f.limits[i].name}, {"holds", f.limits[i].holds != 0}, {"meaning", f.limits[i].meaning}});
  return {{"type", f.type},
          {"summary", f.summary},
          {"origin", e.origin},
          {"quantity", quantity_text(f.quantity)},
          {"parameters", parameters(f.params, f.n_params)},
          {"limits", limits}};
}

std::string list_text(const Json& types) {
  std::string out = "bodies (keys: docs/scenario.md)\n";
  for (const Json& b : types["bodies"]) out += fmt::format("  {:<23} {}\n", b["type"].get<std::string>(), b["summary"].get<std::string>());
  out += "\nhinges                dof\n";
  for (const Json& h : types["hinges"])
    out += fmt::format("  {:<20}{:>3}  {}\n", h["type"].get<std::string>(), h["velocities"].size(), h["summary"].get<std::string>());
  out += "\nhinge loads\n";
  for (const Json& l : types["hinge_loads"])
    out += fmt::format("  {:<23} {}\n", l["type"].get<std::string>(), l["summary"].get<std::string>());
  out += "\ndevices\n";
  for (const Json& d : types["devices"]) out += fmt::format("  {:<23} {}\n", d["type"].get<std::string>(), d["summary"].get<std::string>());
  out += "\nfields\n";
  for (const Json& f : types["fields"]) out += fmt::format("  {:<23} {}\n", f["type"].get<std::string>(), f["summary"].get<std::string>());
  return out + "\ncardan types NAME tells the parameters and the names of the components.\n";
}

std::string components_text(const char* title, const Json& components, const Json& groups) {
  std::string out;
  for (const Json& c : components)
    out += fmt::format("  {:<14}{}{}\n", std::exchange(title, ""), c["name"].get<std::string>(), unit_of(c["unit"].get<std::string>()));
  for (const Json& g : groups)
    out += fmt::format("  {:<14}[{}] together: {}\n", "", fmt::join(g["components"].get<std::vector<std::string>>(), ", "),
                       fmt::join(g["names"].get<std::vector<std::string>>(), " or "));
  return out;
}

std::string parameters_text(const Json& parameters) {
  std::string out;
  const char* title = "parameters";
  for (const Json& p : parameters) {
    const std::string range = p["range"].get<std::string>();
    out += fmt::format("  {:<14}{}: {}{}{}, {}\n", std::exchange(title, ""), p["name"].get<std::string>(), p["kind"].get<std::string>(),
                       unit_of(p["unit"].get<std::string>()), range.empty() ? "" : " " + range, p["default"].get<std::string>());
    out += fmt::format("  {:<16}{}\n", "", p["meaning"].get<std::string>());
  }
  return out;
}

std::string origin_text(const Json& type) {
  return type["origin"] == "built-in" ? "" : fmt::format("  {:<14}{}\n", "plugin", type["origin"].get<std::string>());
}

std::string hinge_text(const Json& h) {
  return fmt::format("hinge {}: {}\n", h["type"].get<std::string>(), h["summary"].get<std::string>()) + parameters_text(h["parameters"]) +
         components_text("coordinates", h["coordinates"], h["coordinate_groups"]) +
         components_text("velocities", h["velocities"], h["velocity_groups"]) + origin_text(h);
}

std::string body_text(const Json& b) {
  return fmt::format("body {}: {}\n  keys: {}; see docs/scenario.md, Bodies\n", b["type"].get<std::string>(),
                     b["summary"].get<std::string>(), fmt::join(b["keys"].get<std::vector<std::string>>(), ", ")) +
         parameters_text(b["parameters"]) + origin_text(b);
}

std::string device_text(const Json& d) {
  const std::string role = d["role"].get<std::string>();
  std::string out = fmt::format("device {}{}: {}\n", d["type"].get<std::string>(), role == "device" ? "" : " (" + role + ")",
                                d["summary"].get<std::string>());
  const char* title = "mounts";
  for (const Json& m : d["mounts"])
    out += fmt::format("  {:<14}{}: {}\n", std::exchange(title, ""), m["name"].get<std::string>(), m["meaning"].get<std::string>());
  out += parameters_text(d["parameters"]);
  for (const char* list : {"inputs", "outputs", "states"}) {
    title = list;
    for (const Json& x : d[list])
      out +=
          fmt::format("  {:<14}{}{}: {}{}\n", std::exchange(title, ""), x["name"].get<std::string>(), unit_of(x["unit"].get<std::string>()),
                      x["meaning"].get<std::string>(), x.value("required", false) ? "; required" : "");
  }
  return out + origin_text(d);
}

std::string field_text(const Json& f) {
  std::string out = fmt::format("field {}: {}\n  {:<14}{}\n", f["type"].get<std::string>(), f["summary"].get<std::string>(), "quantity",
                                f["quantity"].get<std::string>());
  out += parameters_text(f["parameters"]);
  const char* title = "limits";
  for (const Json& l : f["limits"])
    out += fmt::format("  {:<14}{}: {}{}\n", std::exchange(title, ""), l["name"].get<std::string>(), l["meaning"].get<std::string>(),
                       l["holds"].get<bool>() ? "; can hold" : "");
  return out + origin_text(f);
}

struct TypesArguments {
  std::string name;
  std::vector<std::string> plugins;
  bool as_json = false;
};

int tell_types(const TypesArguments& a) {
  Registry registry;
  register_hinges(registry);
  register_bodies(registry);
  register_devices(registry);
  for (const std::string& path : a.plugins) load_plugin(path, registry);
  Json types{{"bodies", Json::array()},
             {"hinges", Json::array()},
             {"hinge_loads", Json::array()},
             {"devices", Json::array()},
             {"fields", Json::array()}};
  std::vector<std::string> legal;
  const auto list = [&](const char* key, const auto& entries) {
    for (const auto& e : entries) {
      legal.emplace_back(e.family->type);
      if (a.name.empty() || a.name == e.family->type) types[key].push_back(to_json(e));
    }
  };
  list("bodies", registry.bodies.all());
  list("hinges", registry.hinges.all());
  list("devices", registry.devices.all());
  list("fields", registry.fields.all());
  for (const HingeLoadType& load : kHingeLoadTypes) {
    legal.emplace_back(load.name);
    if (a.name.empty() || a.name == load.name) types["hinge_loads"].push_back(to_json(load));
  }
  if (std::all_of(types.begin(), types.end(), [](const Json& some) { return some.empty(); }))
    refuse(Code::command_line, {}, fmt::format("one of: {}", fmt::join(legal, ", ")), in_quotes(a.name), did_you_mean(a.name, legal));
  if (a.as_json)
    fmt::print("{}", json_text(types));
  else if (a.name.empty())
    fmt::print("{}", list_text(types));
  else {
    for (const Json& b : types["bodies"]) fmt::print("{}", body_text(b));
    for (const Json& h : types["hinges"]) fmt::print("{}", hinge_text(h));
    for (const Json& d : types["devices"]) fmt::print("{}", device_text(d));
    for (const Json& f : types["fields"]) fmt::print("{}", field_text(f));
    for (const Json& l : types["hinge_loads"])
      fmt::print("hinge load {}: {}\n{}", l["type"].get<std::string>(), l["summary"].get<std::string>(), parameters_text(l["parameters"]));
  }
  return 0;
}

}  // namespace

void add_types(CommandLine& line) {
  Command& command =
      line.command("types", "List the types of bodies, hinges, hinge loads, devices and fields, or tell the parameters of one");
  auto a = std::make_shared<TypesArguments>();
  command.option("name", a->name, "A type; without it, all are listed").type_name("TYPE");
  command.option("--plugin", a->plugins, "Load this plugin first (may be repeated)").type_name("PLUGIN");
  command.flag("--json", a->as_json, "As JSON");
  command.action([a] { return tell_types(*a); });
}

}  // namespace cardan
