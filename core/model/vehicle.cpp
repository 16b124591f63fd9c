#include "core/model/vehicle.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "core/abi/port_vectors.hpp"
#include "core/base/impact.hpp"
#include "core/base/units.hpp"
#include "core/model/device_units.hpp"
#include "core/model/hinge_load_types.hpp"
#include "core/model/initial.hpp"
#include "core/model/loops.hpp"
#include "core/model/params.hpp"
#include "core/model/validate.hpp"

namespace cardan {
namespace {

using Kind = DocNode::Kind;

constexpr char kTerms[] = "{motor: 1, arm.angle: -50}: hinges and their coefficients";

/// "a.rate + b.rate", "_x" -> "a.rate_x + b.rate_x"
std::string each_with_suffix(std::string sources, const std::string& suffix) {
  for (std::size_t at = 0; at <= sources.size();) {
    const std::size_t plus = std::min(sources.find('+', at), sources.size());
    const std::size_t last = plus > 0 ? sources.find_last_not_of(' ', plus - 1) : std::string::npos;
    const std::size_t end = last == std::string::npos || last < at ? plus : last + 1;
    sources.insert(end, suffix);
    at = sources.find('+', end + suffix.size());
    at = at == std::string::npos ? sources.size() + 1 : at + 1;
  }
  return sources;
}

bool is_name(std::string_view name) {
  const auto letter = [](char c) { return std::isalpha(static_cast<unsigned char>(c)) || c == '_'; };
  return !name.empty() && letter(name[0]) && std::all_of(name.begin(), name.end(), [&](char c) {
    return letter(c) || std::isdigit(static_cast<unsigned char>(c)) || c == '-';
  });
}

/// The named objects of a map (bodies, nodes); what has no usable name is reported.
std::vector<std::pair<std::string, DocRef>> named_items(const DocRef& map, ReadContext& context) {
  std::vector<std::pair<std::string, DocRef>> items;
  if (map.node->kind != Kind::map) {
    context.sink.report(Code::wrong_type, map.at(), "a map of names and what they name", describe(*map.node));
    return items;
  }
  for (std::size_t i = 0; i < map.node->items.size(); ++i) {
    const DocKey& key = map.node->keys[i];
    if (is_name(key.name) && key.name != "world")
      items.emplace_back(key.name, map.item(i));
    else
      context.sink.report(Code::bad_name, {map.item(i).path, key.mark}, "a letter, then letters, digits, `_` and `-`; not `world`",
                          in_quotes(key.name));
  }
  return items;
}

class VehicleReader {
 public:
  VehicleReader(const Registry& registry, DiagnosticSink& sink, const SystemSpec* described)
      : registry_(registry), context_{sink, spec_.defaults_used, &spec_.warnings}, described_(described ? *described : spec_) {}

  SystemSpec read(const DocNode& root) {
    spec_.source_file = root.mark.file;
    collect_marks({&root, ""});
    MapReader top({&root, ""}, context_);
    if (const auto version = top.require("cardan", "1, the version of this grammar", "begin the file with `cardan: 1`"))
      if (version->node->text != "1")
        context_.sink.report(Code::out_of_range, version->at(), "1, the version of this grammar", describe(*version->node),
                             "`cardan: 1` is all there has been so far; what says otherwise was written for a later Cardan");
    spec_.name = top.text("name", "a text", "vehicle");
    if (const auto gravity = top.find("gravity"))
      read_gravity(*gravity);
    else
      top.note_default("gravity", "none");
    if (const auto fields = top.find("fields"))
      for (const auto& [name, value] : named_items(*fields, context_)) read_field(name, value);
    if (const auto bodies = top.require("bodies", "a map of the bodies by name"))
      for (const auto& [name, value] : named_items(*bodies, context_)) read_body(name, value);
    if (const auto devices = top.find("devices"))
      for (const auto& [name, value] : named_items(*devices, context_)) read_device(name, value);
    if (const auto loops = top.find("loops"))
      for (const auto& [name, value] : named_items(*loops, context_)) read_loop(name, value);
    if (const auto form = top.find("loop_form"))
      spec_.loop_form =
          static_cast<LoopForm>(std::max(0, read_choice(*form, loop_forms(), "how loops are closed", Code::wrong_type, context_)));
    else if (!spec_.loops.empty())
      top.note_default("loop_form", "auto");
    if (const auto assembly = top.find("assembly")) read_assembly(*assembly);
    top.finish();
    if (top.is_map()) validate(spec_, registry_, context_.sink);
    return std::move(spec_);
  }

 private:
  void collect_marks(const DocRef& value) {
    spec_.marks.emplace(value.path, value.node->mark);
    for (std::size_t i = 0; i < value.node->items.size(); ++i) collect_marks(value.item(i));
  }

  void read_gravity(const DocRef& value) {
    GravitySpec& gravity = spec_.gravity;
    gravity.at = value.at();
    if (value.node->kind == Kind::scalar) {
      read_choice(value, {"none"}, "{uniform: [x, y, z]}, {central: {mu: ...}}, {field: name} or", Code::wrong_type, context_);
      return;
    }
    MapReader map(value, context_);
    if (const auto form = map.one({"uniform", "central", "field"})) {
      if (form->first == 0) {
        gravity.kind = GravitySpec::Kind::uniform;
        gravity.g = read_vector(form->second, "m/s^2", context_);
      } else if (form->first == 2) {
        gravity.kind = GravitySpec::Kind::field;
        gravity.fields = read_names(form->second, "the name of a field, or a list of some");
        gravity.gradient = map.flag("gradient", true);
      } else {
        gravity.kind = GravitySpec::Kind::central;
        MapReader central(form->second, context_);
        gravity.mu = central.number("mu", "m^3/s^2");
        gravity.centre = central.vector("centre", "m", Eigen::Vector3d::Zero());
        gravity.gradient = central.flag("gradient", true);
        central.finish();
      }
    }
    map.finish();
  }

  /// A text, or a list of texts.
  std::vector<std::string> read_names(const DocRef& value, std::string_view expected) {
    if (value.node->kind != Kind::list) return {read_text(value, expected, context_)};
    std::vector<std::string> all;
    for (std::size_t i = 0; i < value.node->items.size(); ++i) all.push_back(read_text(value.item(i), expected, context_));
    return all;
  }

  void read_field(const std::string& name, const DocRef& value) {
    MapReader map(value, context_);
    if (!map.is_map()) return;
    FieldSpec field;
    field.name = name;
    field.at = value.at();
    field.type = map.text("type", "a field type");
    const cardan_field_family* family = registry_.field(field.type);
    if (!family) return spec_.fields.push_back(std::move(field));  // reported by compile(); its keys depend on the type
    read_params(map, {family->params, family->n_params}, field.params);
    if (const auto outside = map.find("outside"))
      field.hold = read_choice(*outside, {"refuse", "hold"}, "what happens beyond its limits", Code::wrong_type, context_) == 1;
    map.finish();
    spec_.fields.push_back(std::move(field));
  }

  void read_body(const std::string& name, const DocRef& value) {
    MapReader map(value, context_);
    if (!map.is_map()) return;
    BodySpec body;
    body.name = name;
    body.at = value.at();
    body.type = map.text("type", "a body type", "rigid");
    const cardan_body_family* family = registry_.body(body.type);
    if (family) read_inertia_of(*family, map, body);
    if (const auto hinge = map.require("hinge", "how the body hangs on another one or on the world",
                                       "a body that flies freely: hinge: {type: free, to: world}"))
      read_hinge(*hinge, body);
    // Of a body of unknown type only the type is reported: which keys it may have depends on it.
    if (family) map.finish(has_modes(*family) ? "mass and nodes of a flexible body are those of its modal source" : "");
    spec_.bodies.push_back(std::move(body));
  }

  void read_inertia_of(const cardan_body_family& family, MapReader& map, BodySpec& body) {
    if (has_modes(family)) {
      read_flexible(map, body);
    } else if (family.mass_source != CARDAN_MASS_COMPUTED) {
      read_mass(map, family.mass_source == CARDAN_MASS_POINT, body);
    }
    if (!has_modes(family)) read_nodes(map, body);
    const std::size_t faults = context_.sink.all().size();
    read_params(map, {family.params, family.n_params}, body.params);
    if (context_.sink.all().size() == faults) compute_mass(spec_, body, family, context_.sink);
  }

  void read_mass(MapReader& map, bool point, BodySpec& body) {
    body.mass = map.number("mass", "kg");
    body.com = map.vector("com", "m", Eigen::Vector3d::Zero());
    if (point) return;
    const auto inertia =
        map.require("inertia", "[xx, yy, zz] or {xx, yy, zz, xy, xz, yz, about} in kg m^2", "a body without extent is `type: particle`");
    if (inertia) body.inertia_com = read_inertia(*inertia, body.mass, body.com, context_);
  }

  void read_nodes(MapReader& map, BodySpec& body) {
    if (const auto nodes = map.find("nodes"))
      for (const auto& [name, value] : named_items(*nodes, context_)) {
        NodeSpec node;
        node.name = name;
        node.at = value.at();
        MapReader reader(value, context_);
        node.position = reader.vector("position", "m", Eigen::Vector3d::Zero());
        if (const auto orientation = reader.find("orientation")) node.R_BN = read_orientation(*orientation, context_);
        reader.finish();
        body.nodes.push_back(std::move(node));
      }
  }

  /// exact, or the part of a modal mass that terms may have which are left out.
  double read_rotary_tolerance(const DocRef& value) {
    constexpr const char* kExpected = "exact, or a part of modal masses from 0 to below 1";
    const bool is_word = value.node->kind == Kind::scalar && std::isalpha(static_cast<unsigned char>(value.node->text[0]));
    if (is_word && value.node->text != "exact")
      context_.sink.report(Code::bad_number, value.at(), kExpected, fmt::format("\"{}\"", value.node->text));
    if (is_word) return 0.0;
    const double tolerance = read_number(value, "1", context_);
    if (!(tolerance >= 0.0 && tolerance < 1.0))
      context_.sink.report(Code::out_of_range, value.at(), kExpected, fmt::format("{:g}", tolerance));
    return tolerance;
  }

  void read_flexible(MapReader& map, BodySpec& body) {
    body.level = map.integer("level", 0, 1);
    if (const auto kept = map.find("rotary_inertia")) body.rotary_tolerance = read_rotary_tolerance(*kept);
    if (const auto modal = map.require("modal", "where the modes come from: a plate, a beam, a file or lumped masses"))
      body.modal_source = std::make_shared<const DocNode>(*modal->node);
    if (const auto initial = map.find("initial")) {
      MapReader reader(*initial, context_);
      if (const auto eta = reader.find("eta")) body.eta = read_numbers(*eta, "1", 0, context_);
      if (const auto etadot = reader.find("etadot")) body.etadot = read_numbers(*etadot, "1/s", 0, context_);
      reader.finish();
    }
  }

  DeviceSpec::Mount read_mount(const DocRef& value, const cardan_mount_desc& desc) {
    DeviceSpec::Mount mount;
    mount.at = value.at();
    if (desc.kind != CARDAN_MOUNT_NODE || value.node->kind != Kind::map) {
      mount.target = read_text(value, desc.meaning, context_);
      return mount;
    }
    MapReader map(value, context_);
    mount.target = map.text("body", "world");
    read_place_keys(map, mount.position, mount.R);
    map.finish();
    if (mount.target != "world" && !mount.target.empty())
      context_.sink.report(Code::wrong_type, value.at(), "a place of the world", "one of " + in_quotes(mount.target),
                           "give the body a node there, and mount the device at its name");
    return mount;
  }

  void read_device(const std::string& name, const DocRef& value) {
    MapReader map(value, context_);
    if (!map.is_map()) return;
    DeviceSpec device;
    device.name = name;
    device.at = value.at();
    device.type = map.text("type", "a device type");
    const cardan_device_family* family = registry_.device(device.type);
    if (!family) return spec_.devices.push_back(std::move(device));  // reported by validate(); its keys depend on the type
    for (uint32_t i = 0; i < family->n_mounts; ++i)
      if (const auto mount = map.find(family->mounts[i].name))
        device.mounts[family->mounts[i].name] = read_mount(*mount, family->mounts[i]);
    const bool turning = turns(described_, registry_, device, *family);
    read_params(map, schema_where(turning, *family), device.params);
    if (family->tick)
      if (const auto given = map.one({"rate", "period"})) {
        const bool rate = given->first == 0;
        (rate ? device.rate : device.period) = read_number(given->second, rate ? "Hz" : "s", context_);
        if (const auto offset = map.find("offset")) device.offset = read_number(*offset, "s", context_);
      }
    if (const auto inputs = map.find("inputs")) read_inputs(*inputs, *family, turning, device);
    if (const auto initial = map.find("initial")) {
      MapReader reader(*initial, context_);
      for (const auto& [all, n] : {std::pair(family->states, family->n_states), std::pair(family->marks, family->n_marks)})
        for (uint32_t i = 0; i < n; ++i)
          if (const auto given = reader.find(all[i].name))
            device.initial.emplace(all[i].name, ParamValue{read_number(*given, unit_where(turning, all[i].unit), context_), given->at()});
      reader.finish();
    }
    map.finish();
    spec_.devices.push_back(std::move(device));
  }

  void read_inputs(const DocRef& value, const cardan_device_family& family, bool turning, DeviceSpec& device) {
    MapReader map(value, context_);
    const auto take = [&](const std::string& name, const std::vector<std::string>& suffixes, const char* unit) {
      const auto given = map.find(name);
      if (!given) return;
      const std::vector<DeviceSpec::Input> all = read_input(*given, unit_where(turning, unit), suffixes);
      for (std::size_t i = 0; i < all.size(); ++i)
        if (!device.inputs.emplace(name + suffixes[i], all[i]).second)
          context_.sink.report(Code::duplicate_key, given->at(), fmt::format("{} once", name + suffixes[i]),
                               fmt::format("{} and {}", name, name + suffixes[i]));
    };
    for (uint32_t i = 0; i < family.n_ports; ++i)
      if (const cardan_port_desc& port = family.ports[i]; port.kind == CARDAN_PORT_IN) take(port.name, {""}, port.unit);
    for (const PortVector& v : port_vectors(family, CARDAN_PORT_IN))
      take(v.name, v.suffixes, port_at(family, CARDAN_PORT_IN, v.first).unit);
    map.finish();
  }

  /// A number, "device.output", {from: gyro.rate_x, delay: 1}, {sum: [a.torque, b.torque], latency: 30 ms}, {value: 0.1 N m, safe: 0,
  /// timeout: 200 ms}; of each port of a vector, whose suffixes are those of what it takes.
  std::vector<DeviceSpec::Input> read_input(const DocRef& value, const std::string& unit, const std::vector<std::string>& suffixes) {
    constexpr const char* kSource = "an output of a device";
    std::vector<DeviceSpec::Input> all(suffixes.size(), {0.0, value.at()});
    const auto numbers = [&](const DocRef& from, const auto& put) {
      if (suffixes.size() == 1) return put(all[0], read_number(from, unit, context_));
      const std::vector<double> given = read_numbers(from, unit, suffixes.size(), context_);
      for (std::size_t i = 0; i < given.size() && i < all.size(); ++i) put(all[i], given[i]);
    };
    const auto number = [&](const DocRef& from) { numbers(from, [](DeviceSpec::Input& input, double x) { input.value = x; }); };
    const auto connect = [&](const std::vector<std::string>& sources) {
      for (std::size_t i = 0; i < all.size(); ++i)
        all[i].value = each_with_suffix(fmt::format("{}", fmt::join(sources, " + ")), suffixes[i]);
    };
    if (value.node->kind != Kind::map) {
      const std::string& text = value.node->text;
      const bool names = value.node->kind == Kind::scalar && !text.empty() && std::isalpha(static_cast<unsigned char>(text[0])) &&
                         text.find('.') != std::string::npos;
      names ? connect({text}) : number(value);
      return all;
    }
    MapReader map(value, context_);
    const auto form = map.one({"from", "sum", "value"});
    if (form && form->first == 0) connect({read_text(form->second, kSource, context_)});
    if (form && form->first == 2) number(form->second);
    if (form && form->first == 1) {
      const DocRef& list = form->second;
      if (list.node->kind != Kind::list || list.node->items.empty()) {
        context_.sink.report(Code::wrong_type, list.at(), "a list of outputs of devices", describe(*list.node));
      } else {
        std::vector<std::string> sources;
        for (std::size_t i = 0; i < list.node->items.size(); ++i) sources.push_back(read_text(list.item(i), kSource, context_));
        connect(sources);
      }
    }
    DeviceSpec::Input more;
    if (form && form->first == 2) {
      if (const auto safe = map.find("safe")) numbers(*safe, [](DeviceSpec::Input& input, double x) { input.safe = x; });
      more.timeout = map.number("timeout", "s", 0.0);
    } else {
      more.delay = map.integer("delay", 0, 0);
      more.latency = map.number("latency", "s", 0.0);
    }
    for (DeviceSpec::Input& input : all) input.timeout = more.timeout, input.delay = more.delay, input.latency = more.latency;
    map.finish();
    return all;
  }

  void read_loop(const std::string& name, const DocRef& value) {
    MapReader map(value, context_);
    if (!map.is_map()) return;
    LoopSpec loop;
    loop.name = name;
    loop.at = value.at();
    loop.type = map.text("type", "a closure or a hinge type");
    loop.open = map.flag("open", false);
    if (loop.type == "weld" || loop.type == "coupling") loop.as_found = map.flag("as_found", false);
    const std::vector<std::string>& closures = closure_types();
    const cardan_hinge_family* family = registry_.hinge(loop.type);
    const bool known = family || std::ranges::find(closures, loop.type) != closures.end();
    if (!known) return spec_.loops.push_back(std::move(loop));  // reported by compile(); its keys depend on the type
    if (loop.type == "coupling") {
      const auto terms = map.find("terms"), functions = map.find("functions");
      if (!terms && !functions) map.require("terms", kTerms, "or functions: [{of: {cam: 1}, sine: 0.02}]");
      if (terms) read_terms(*terms, loop.terms);
      if (functions) read_functions(*functions, loop);
      loop.offset = map.number("offset", "1", 0.0);
    } else {
      if (const auto from = map.require("from", "a body, body.node or world")) read_end(*from, loop.from);
      if (const auto to = map.require("to", "a body, body.node or world")) read_end(*to, loop.to);
      if (loop.type == "distance") loop.length = map.number("length", "m");
      if (family) read_params(map, {family->params, family->n_params}, loop.params);
    }
    if (loop.type == "coupling" || loop.type == "distance") loop.prescribed = map.flag("prescribed", false);
    map.finish();
    spec_.loops.push_back(std::move(loop));
  }

  void read_assembly(const DocRef& value) {
    MapReader map(value, context_);
    if (!map.is_map()) return;
    spec_.assembly.at = value.at();
    if (spec_.loops.empty()) context_.sink.report(Code::missing_key, value.at(), "loops, whose start it says how to close", "no such key");
    if (const auto hold = map.find("hold")) {
      spec_.assembly.hold.emplace();
      if (hold->node->kind != Kind::list)
        context_.sink.report(Code::wrong_type, hold->at(), "a list of hinges", describe(*hold->node), "none of them stays: hold: []");
      for (std::size_t i = 0; hold->node->kind == Kind::list && i < hold->node->items.size(); ++i)
        spec_.assembly.hold->push_back(read_text(hold->item(i), "a hinge, or a component of one", context_));
    }
    if (const auto weights = map.find("weights")) {
      if (weights->node->kind != Kind::map)
        context_.sink.report(Code::wrong_type, weights->at(), "a map of hinges and weights", describe(*weights->node));
      for (std::size_t i = 0; weights->node->kind == Kind::map && i < weights->node->items.size(); ++i)
        spec_.assembly.weights[weights->node->keys[i].name] = read_number(weights->item(i), "1", context_);
    }
    map.finish();
  }

  void read_functions(const DocRef& value, LoopSpec& loop) {
    if (value.node->kind != Kind::list || value.node->items.empty())
      return context_.sink.report(Code::wrong_type, value.at(), "a list of functions: [{of: {cam: 1}, sine: 0.02}]", describe(*value.node));
    for (std::size_t i = 0; i < value.node->items.size(); ++i) {
      MapReader map(value.item(i), context_);
      if (!map.is_map()) continue;
      LoopSpec::Function f;
      f.at = value.item(i).at();
      if (const auto of = map.require("of", kTerms)) read_terms(*of, f.of);
      f.phase = map.number("phase", "1", 0.0), f.scale = map.number("scale", "1", 1.0);
      if (const auto form = map.one(function_kinds())) {
        f.kind = function_kinds()[form->first];
        if (f.kind == "table")
          f.periodic = map.flag("periodic", false), f.numbers = read_points(form->second);
        else if (f.kind == "polynomial")
          f.numbers = read_numbers(form->second, "1", 0, context_);
        else
          f.numbers = {read_number(form->second, "1", context_)};
      }
      map.finish();
      loop.functions.push_back(std::move(f));
    }
  }
  std::vector<double> read_points(const DocRef& value) {
    if (value.node->kind != Kind::list) context_.sink.report(Code::wrong_type, value.at(), "a list of rows [x, F]", describe(*value.node));
    std::vector<double> all;
    for (std::size_t i = 0; value.node->kind == Kind::list && i < value.node->items.size(); ++i)
      for (const double x : read_numbers(value.item(i), "1", 2, context_)) all.push_back(x);
    return all;
  }

  void read_terms(const DocRef& value, std::vector<LoopSpec::Term>& terms) {
    if (value.node->kind != Kind::map)
      return context_.sink.report(Code::wrong_type, value.at(), "a map of hinges and coefficients", describe(*value.node));
    for (std::size_t i = 0; i < value.node->items.size(); ++i)
      terms.push_back({value.node->keys[i].name, read_number(value.item(i), "1", context_), value.item(i).at()});
  }

  /// In "body.node": a point that nothing follows is no origin.
  std::string node_behind(std::size_t point, const std::string& name, const Located& at) {
    if (point + 1 == name.size()) context_.sink.report(Code::unknown_node, at, "a body, body.node or world", in_quotes(name));
    return name.substr(point + 1);
  }

  void read_end(const DocRef& value, PlaceSpec& place) {
    place.at = value.at();
    std::string name;
    if (value.node->kind == Kind::map) {
      MapReader map(value, context_);
      place.body = name = map.text("body", "a body or world");
      read_place_keys(map, place.position, place.R);
      map.finish();
    } else {
      name = read_text(value, "a body, body.node or world", context_);
      const auto point = name.find('.');
      place.body = name.substr(0, point);
      if (point != std::string::npos) place.node = node_behind(point, name, value.at());
    }
    if (place.body.empty() && !name.empty())
      context_.sink.report(Code::unknown_body, value.at(), "a body, body.node or world", in_quotes(name));
    if (place.body == "world") place.body.clear();
  }

  void read_hinge(const DocRef& value, BodySpec& body) {
    MapReader map(value, context_);
    if (!map.is_map()) return;
    HingeSpec& hinge = body.hinge;
    hinge.at = value.at();
    hinge.type = map.text("type", "a hinge type");
    if (const auto to = map.require("to", "a body, body.node or world")) read_inboard(*to, hinge);
    if (const auto at = map.find("at")) {
      if (at->node->kind == Kind::map)
        read_place(*at, hinge.pnode_position, hinge.pnode_R);
      else
        hinge.body_node = read_text(*at, "a node of the body, or {position, orientation}", context_);
    } else {
      map.note_default("at", "the origin of the body");
    }
    hinge.locked = map.flag("locked", false);
    const cardan_hinge_family* family = registry_.hinge(hinge.type);
    if (!family) return;  // reported by validate(); the other keys depend on the type
    read_params(map, {family->params, family->n_params}, hinge.params);
    if (const auto initial = map.find("initial")) read_initial_values(*initial, *family, body);
    if (family->nv > 0) {
      if (const auto prescribed = map.find("prescribed")) read_prescribed(*prescribed, *family, hinge);
      if (const auto spring = map.find("spring")) read_spring(*spring, *family, hinge);
      if (const auto springs = map.find("springs")) read_springs(*springs, *family, hinge);
      if (const auto loads = map.find("loads")) read_loads(*loads, *family, hinge);
    }
    if (const auto factor = map.find("factor"))
      hinge.factor = static_cast<HingeFactor>(
          std::max(0, read_choice(*factor, hinge_factors(), "how its inertia is factored", Code::wrong_type, context_)));
    map.finish();
  }

  void read_inboard(const DocRef& to, HingeSpec& hinge) {
    if (to.node->kind == Kind::list) {
      std::string names;
      for (const DocNode& item : to.node->items) names += (names.empty() ? "" : " and ") + describe(item);
      context_.sink.report(Code::two_parents, to.at(), "one body, body.node or world", names,
                           "the hinges of a vehicle form a tree: hang the body on one of them");
      return;
    }
    std::string name;
    if (to.node->kind == Kind::map) {
      MapReader map(to, context_);
      name = map.text("body", "a body or world");
      read_place_keys(map, hinge.onode_position, hinge.onode_R);
      map.finish();
      hinge.inboard_body = name;
    } else {
      name = read_text(to, "a body, body.node or world", context_);
      const auto point = name.find('.');
      hinge.inboard_body = name.substr(0, point);
      if (point != std::string::npos) hinge.inboard_node = node_behind(point, name, to.at());
    }
    if (hinge.inboard_body.empty() && (to.node->kind == Kind::scalar || to.node->kind == Kind::map))
      context_.sink.report(Code::unknown_body, to.at(), "a body, body.node or world", in_quotes(name));
    if (hinge.inboard_body == "world") hinge.inboard_body.clear();
  }
  void read_place(const DocRef& value, Eigen::Vector3d& position, Eigen::Matrix3d& R) {
    MapReader map(value, context_);
    read_place_keys(map, position, R);
    map.finish();
  }
  void read_place_keys(MapReader& map, Eigen::Vector3d& position, Eigen::Matrix3d& R) {
    position = map.vector("position", "m", Eigen::Vector3d::Zero());
    if (const auto orientation = map.find("orientation")) R = read_orientation(*orientation, context_);
  }

  /// What is not given is as `zero` of the family has it, which may follow from its parameters: their faults are told by validate().
  void read_initial_values(const DocRef& value, const cardan_hinge_family& family, BodySpec& body) {
    HingeSpec& hinge = body.hinge;
    hinge.q.assign(family.nq, 0.0), hinge.v.assign(family.nv, 0.0);
    if (DiagnosticSink told; family.zero)
      if (const std::vector<double> packed = pack_hinge(spec_, body, family, told); told.empty())
        family.zero(packed.data(), hinge.q.data());
    MapReader map(value, context_);
    const InitialGiven given = read_initial(map, family, hinge.q.data(), hinge.v.data());
    if (!given.coordinates) hinge.q.clear();
    if (!given.velocities) hinge.v.clear();
    map.finish();
  }

  /// Index of a velocity component by its name, or by that of its coordinate; -1 after a fault.
  int read_component(const DocRef& value, const cardan_hinge_family& family) {
    std::vector<std::string> legal(family.v_names, family.v_names + family.nv);
    if (family.nq == family.nv) legal.insert(legal.end(), family.q_names, family.q_names + family.nq);
    const int i = read_choice(value, legal, fmt::format("a component of hinge type {}", family.type), Code::unknown_name, context_);
    return i < 0 ? i : i % static_cast<int>(family.nv);
  }

  void read_prescribed(const DocRef& value, const cardan_hinge_family& family, HingeSpec& hinge) {
    if (value.node->kind == Kind::list) {
      for (std::size_t i = 0; i < value.node->items.size(); ++i) {
        const int component = read_component(value.item(i), family);
        if (component >= 0) hinge.prescribed.push_back(component);
      }
    } else if (read_flag(value, context_)) {
      for (uint32_t i = 0; i < family.nv; ++i) hinge.prescribed.push_back(static_cast<int>(i));
    }
  }

  void read_springs(const DocRef& value, const cardan_hinge_family& family, HingeSpec& hinge) {
    if (value.node->kind != Kind::list) {
      context_.sink.report(Code::wrong_type, value.at(), "a list of springs", describe(*value.node), "one spring alone: spring: {...}");
      return;
    }
    for (std::size_t i = 0; i < value.node->items.size(); ++i) read_spring(value.item(i), family, hinge);
  }
  /// Of a spring or load; -1 after a fault.
  int read_own_component(MapReader& map, const cardan_hinge_family& family) {
    if (family.nv > 1) {
      const auto component =
          map.require("component", "which component of the hinge: " + one_of({family.v_names, family.v_names + family.nv}));
      return component ? read_component(*component, family) : -1;
    }
    const auto component = map.find("component");
    return component ? std::max(0, read_component(*component, family)) : 0;
  }

  void read_loads(const DocRef& value, const cardan_hinge_family& family, HingeSpec& hinge) {
    if (value.node->kind != Kind::list) {
      context_.sink.report(Code::wrong_type, value.at(), "a list of loads", describe(*value.node), "loads: [{type: stop, ...}]");
      return;
    }
    for (std::size_t i = 0; i < value.node->items.size(); ++i) read_load(value.item(i), family, hinge);
  }

  void read_load(const DocRef& value, const cardan_hinge_family& family, HingeSpec& hinge) {
    const std::size_t faults = context_.sink.all().size();
    MapReader map(value, context_);
    HingeLoadSpec load;
    load.at = value.at();
    std::vector<std::string> legal;
    for (const HingeLoadType& known : kHingeLoadTypes) legal.emplace_back(known.name);
    const auto given = map.require("type", one_of(legal));
    const int i = given ? read_choice(*given, legal, "a type of load", Code::unknown_name, context_) : -1;
    load.component = i < 0 ? -1 : read_own_component(map, family);
    if (load.component < 0) return;
    const HingeLoadType& type = kHingeLoadTypes[static_cast<std::size_t>(i)];
    load.law = type.law;
    const bool turns = std::string_view(family.v_units[load.component]) == "rad/s";
    const auto value_of = [&](std::string_view name) -> double& {
      const auto p = std::ranges::find(type.parameters, name, [](const HingeLoadParameter& q) { return std::string_view(q.name); });
      return load.parameters[static_cast<std::size_t>(p - type.parameters.begin())];
    };
    for (const bool by_others : {false, true})  // those that go by the value of another one come last
      for (const HingeLoadParameter& p : type.parameters) {
        if ((p.times || p.unit_where_one) != by_others) continue;
        const char* unit = p.unit_where_one && value_of(p.unit_where_one) != 1.0 ? "1" : turns ? p.turns : p.slides;
        double& x = value_of(p.name);
        if (std::isnan(p.fallback))
          x = map.number(p.name, unit);
        else if (!p.times && std::isfinite(p.fallback))
          x = map.number(p.name, unit, p.fallback);
        else
          x = map.find(p.name) ? map.number(p.name, unit) : p.fallback * (p.times ? value_of(p.times) : 1.0);
      }
    map.finish();
    if (type.bounces) {
      load.bounce = {value_of("restitution"), value_of("speed")};
      value_of("restitution") = 1.0, value_of("speed") = 0.0;  // exponent and dissipation of a stop
      if (load.bounce.restitution <= 1.0 && load.bounce.speed > 0.0)
        value_of("speed") = dissipation_times_speed(std::max(load.bounce.restitution, 0.05)) / load.bounce.speed;
    }
    if (context_.sink.all().size() == faults) hinge.loads.push_back(std::move(load));  // else its numbers say nothing
  }

  void read_spring(const DocRef& value, const cardan_hinge_family& family, HingeSpec& hinge) {
    MapReader map(value, context_);
    SpringDamper spring;
    spring.at = value.at();
    spring.component = read_own_component(map, family);
    if (spring.component < 0) return;
    const bool rotational = std::string_view(family.v_units[spring.component]) == "rad/s";
    spring.stiffness = map.number("stiffness", rotational ? "N m/rad" : "N/m", 0.0);
    spring.rest = map.number("rest", rotational ? "rad" : "m", 0.0);
    spring.damping = map.number("damping", rotational ? "N m s/rad" : "N s/m", 0.0);
    map.finish();
    hinge.springs.push_back(std::move(spring));
  }

  const Registry& registry_;
  SystemSpec spec_;
  ReadContext context_;
  const SystemSpec& described_;  // of whose hinges the units of devices are
};

}  // namespace

Eigen::Matrix3d read_inertia(const DocRef& value, double mass, const Eigen::Vector3d& com, ReadContext& context) {
  if (value.node->kind == DocNode::Kind::list) {
    const bool rows = std::ranges::any_of(value.node->items, [](const DocNode& x) { return x.kind == DocNode::Kind::list; });
    if (const std::size_t n = value.node->items.size(); n != 3 || rows) {
      context.sink.report(Code::wrong_type, value.at(), "[xx, yy, zz] or {xx, yy, zz, xy, xz, yz, about} in kg m^2",
                          fmt::format("a list of {} {}", n, rows ? "rows" : "values"),
                          "off the diagonal by name: {xx: ..., yy: ..., zz: ..., xy: ...}");
      return Eigen::Matrix3d::Identity();
    }
    return read_vector(value, "kg m^2", context).asDiagonal();
  }
  MapReader map(value, context);
  const double xx = map.number("xx", "kg m^2"), yy = map.number("yy", "kg m^2"), zz = map.number("zz", "kg m^2");
  const auto product = [&](std::string_view key) {
    const auto given = map.find(key);
    return given ? read_number(*given, "kg m^2", context) : 0.0;
  };
  const double xy = product("xy"), xz = product("xz"), yz = product("yz");
  Eigen::Matrix3d I;
  I << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  const auto about = map.find("about");
  if (!about) map.note_default("about", "com");
  if (about && read_choice(*about, {"com", "origin"}, "the point it is about", Code::wrong_type, context) == 1)
    I -= mass * (com.squaredNorm() * Eigen::Matrix3d::Identity() - com * com.transpose());
  map.finish();
  return I;
}

SystemSpec vehicle_from_doc(const DocNode& root, const Registry& registry, DiagnosticSink& sink, const SystemSpec* described) {
  return VehicleReader(registry, sink, described).read(root);
}

}  // namespace cardan
