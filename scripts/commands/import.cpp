// `cardan import`: a robot description of others as a vehicle (docs/import.md).
#include "scripts/import/import.hpp"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "bodies/register.hpp"
#include "core/base/units.hpp"
#include "core/io/result_folder.hpp"
#include "core/io/yaml_reader.hpp"
#include "core/model/model.hpp"
#include "hinges/register.hpp"
#include "plugins/devices/register.hpp"
#include "scripts/commands/commands.hpp"
#include "scripts/commands/streams.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

struct ImportArguments {
  std::string file, out, base;
  std::vector<std::string> leave_out, initial;
  std::string stop_stiffness, friction_width;
};

double positive(const std::string& option, const std::string& text) {
  const auto value = parse_number(text);
  if (!value || !(*value > 0)) refuse(Code::command_line, {option}, "a number > 0, in SI", in_quotes(text));
  return *value;
}

ImportOptions options_of(const ImportArguments& a) {
  ImportOptions o;
  if (a.base == "free")
    o.base = ImportOptions::Base::free;
  else if (a.base == "fixed")
    o.base = ImportOptions::Base::fixed;
  else if (!a.base.empty())
    refuse(Code::command_line, {"--base"}, "free or fixed", in_quotes(a.base), did_you_mean(a.base, {"free", "fixed"}));
  o.leave_out = a.leave_out;
  for (const std::string& text : a.initial) {
    const std::size_t equals = text.rfind('=');
    if (equals == 0 || equals == std::string::npos)
      refuse(Code::command_line, {"--initial"}, "joint=value", in_quotes(text), "--initial shoulder=\"30 deg\"");
    o.initial.emplace_back(text.substr(0, equals), text.substr(equals + 1));
  }
  if (!a.stop_stiffness.empty()) o.stop_stiffness = positive("--stop-stiffness", a.stop_stiffness);
  if (!a.friction_width.empty()) o.friction_width = positive("--friction-width", a.friction_width);
  return o;
}

/// Reads what was written as a run will; what it refuses is told at its place in the robot file.
std::shared_ptr<const Model> tried(const Imported& imported, const std::string& out) {
  Registry registry;
  register_hinges(registry), register_bodies(registry), register_devices(registry);
  try {
    return compile(vehicle_from_text(imported.yaml, out, registry), registry);
  } catch (const InputError& e) {
    std::vector<Diagnostic> all = e.diagnostics();
    for (Diagnostic& d : all) d = imported.at_its_source(std::move(d));
    throw InputError(std::move(all));
  }
}

/// A pipe may come from a program that expands macros, and is waited for; what else is no file has no text that ends.
void expect_text(const std::string& file) {
  std::error_code none;
  const fs::file_status is = fs::status(file, none);
  if (fs::exists(is) && !fs::is_regular_file(is) && !fs::is_fifo(is))
    refuse(Code::file_not_found, {"", {file}}, "a file or a pipe", fs::is_directory(is) ? "a folder" : "a device or a socket");
}

int import_file(const ImportArguments& a) {
  const ImportOptions options = options_of(a);
  expect_text(a.file);
  const Imported imported = import_robot(read_text_file(a.file), a.file, options);
  const fs::path out = a.out.empty() ? fs::path(a.file).stem().concat(".yaml") : fs::path(a.out);
  std::error_code ignored;
  if (a.out.empty() && fs::exists(out, ignored))
    refuse(Code::cannot_write, {"", {out.string()}}, "a file that is not there yet", "one that is",
           "--out names the file, which then is replaced");
  expect_another_file(out, a.file);
  const auto model = tried(imported, out.string());
  write_whole_file(out, imported.yaml);
  say(fmt::format("{}: {} {}, {} coordinates, {} velocities, {} {}\n", out.string(), imported.bodies,
                  imported.bodies == 1 ? "body" : "bodies", model->nq, model->nv, imported.loops, imported.loops == 1 ? "loop" : "loops"));
  for (const std::string& note : imported.notes) say(fmt::format("  {}\n", note));
  return 0;
}

}  // namespace

void add_import(CommandLine& line) {
  Command& command = line.command("import", "Write a vehicle from a robot description: URDF or MJCF");
  auto a = std::make_shared<ImportArguments>();
  command.option("file", a->file, "The robot: a URDF or MJCF file, told by its root element; /dev/stdin for what a pipe brings")
      .required()
      .type_name("ROBOT");
  command
      .option("--out", a->out, "The vehicle file (default: the name of the robot file with .yaml, in this folder, if it is not there yet)")
      .type_name("VEHICLE");
  command.option("--base", a->base, "The root link of a URDF: free, or fixed to the world (default: free if it has mass)")
      .type_name("BASE");
  command
      .option("--leave-out", a->leave_out,
              "Do without what cannot be honoured, by the name that the refusal tells: armature, or one loop by its own")
      .type_name("NAME");
  command.option("--initial", a->initial, "A coordinate at the start, such that loops are closed: elbow=\"30 deg\"")
      .type_name("JOINT=VALUE");
  command.option("--stop-stiffness", a->stop_stiffness, "Make stops of limits, of so many N m/rad or N/m").type_name("K");
  command.option("--friction-width", a->friction_width, "Take dry friction over, smoothed over so many rad/s or m/s").type_name("W");
  command.action([a] { return import_file(*a); });
}

}  // namespace cardan
