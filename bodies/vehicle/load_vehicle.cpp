#include "bodies/vehicle/load_vehicle.hpp"

#include <fmt/format.h>

#include <map>

#include "bodies/vehicle/modal_reader.hpp"
#include "core/base/activity.hpp"
#include "core/model/doubts.hpp"
#include "core/model/validate.hpp"

namespace cardan {
namespace {

/// Equal texts describe equal modes.
std::string text_of(const DocNode& node) {
  std::string out = fmt::format("{} {} {} {} ", static_cast<int>(node.kind), node.items.size(), node.text.size(), node.text);
  for (const DocKey& key : node.keys) out += fmt::format("{} {} ", key.name.size(), key.name);
  for (const DocNode& item : node.items) out += text_of(item);
  return out;
}

/// bodies/modal names the fields of its own structures: here they get the key and the place that the user wrote. Names in a modal file stay
/// in the text.
Diagnostic in_words_of_the_vehicle(Diagnostic d, const std::string& path, const ModalSource& source, const SystemSpec& spec) {
  std::string field = d.at.key_path.starts_with(path + ".") ? d.at.key_path.substr(path.size() + 1) : "";
  if (field.starts_with("panel.")) field.replace(0, 5, spec.marks.count(path + ".plate.solid") ? "solid" : "sandwich");
  for (std::size_t i = 0; i < source.points.size(); ++i)
    if (const std::string point = fmt::format("points[{}]", i); field.starts_with(point))
      field.replace(0, point.size(), "nodes." + source.points[i].name);
  if (d.at.key_path.starts_with('/') && !d.expected.starts_with(d.at.key_path)) d.expected = d.at.key_path + ": " + d.expected;
  const bool in_a_file = !d.at.mark.file.empty() && d.at.mark.file != spec.source_file;
  const SourceMark mark = d.at.mark;
  d.at = spec.locate(path);
  for (const char* model : {".", ".plate.", ".beam.", ".lumped.", ".matrices.", ".solid."})
    if (spec.marks.count(path + model + field)) d.at = spec.locate(path + model + field);
  if (in_a_file) d.at.mark = mark;
  return d;
}

ModeCache::Modes solve(const ModalSource& source, const std::string& path, SystemSpec& spec, const ModeCache& cache) {
  Warnings warnings;
  const Activity activity("the modes of " + path.substr(0, path.rfind('.')));
  try {
    ModeCache::Modes modes = cache.make(source, &warnings);
    for (const Warning& w : warnings.all()) spec.warnings.add(in_words_of_the_vehicle(w.what, path, source, spec));
    return modes;
  } catch (const InputError& e) {
    std::vector<Diagnostic> all = e.diagnostics();
    for (Diagnostic& d : all) d = in_words_of_the_vehicle(std::move(d), path, source, spec);
    throw InputError(std::move(all));
  }
}

}  // namespace

void take_modes(SystemSpec& spec, const SystemSpec& made) {
  for (BodySpec& body : spec.bodies)
    if (const BodySpec* other = made.find(body.name);
        body.modal_source && other && other->modal_source && other->modal && text_of(*body.modal_source) == text_of(*other->modal_source))
      body.modal = other->modal;
}

std::vector<std::string> make_modes(SystemSpec& spec, const ModeCache& cache) {
  DiagnosticSink sink;
  ReadContext context{sink, spec.defaults_used, &spec.warnings};
  std::map<std::string, ModalSource> sources;  // by body
  for (const BodySpec& body : spec.bodies)
    if (body.modal_source && !body.modal)
      sources.emplace(body.name, read_modal_source({body.modal_source.get(), body_path(body) + ".modal"}, context));
  sink.throw_if_any();

  std::map<std::string, std::shared_ptr<const ModeCache::Modes>> solved;  // by text
  std::vector<std::string> from_cache;
  for (BodySpec& body : spec.bodies) {
    const auto source = sources.find(body.name);
    if (source == sources.end()) continue;
    auto& modes = solved[text_of(*body.modal_source)];
    if (!modes) modes = std::make_shared<const ModeCache::Modes>(solve(source->second, body_path(body) + ".modal", spec, cache));
    body.modal = {modes, &modes->data};
    if (modes->from_cache) from_cache.push_back(body.name);
  }
  validate(spec, sink);
  sink.throw_if_any();
  spec.warnings.add(doubts(spec));
  return from_cache;
}

std::shared_ptr<const SystemSpec> load_vehicle(const std::string& path, const Registry& registry, const Overrides& overrides) {
  auto spec = std::make_shared<SystemSpec>(read_vehicle(path, registry, overrides));
  make_modes(*spec);
  spec->warnings.add(held_back(*spec));
  return spec;
}

}  // namespace cardan
