// `cardan modes`: the modes of a flexible body as a modal file, for other vehicles or other programs (docs/modal_files.md).
#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include "bodies/modal/modal_file.hpp"
#include "core/base/units.hpp"
#include "core/io/result_folder.hpp"
#include "scripts/bindings/open.hpp"
#include "scripts/commands/commands.hpp"

namespace cardan {
namespace {

struct ModesArguments {
  ScenarioArguments scenario;
  std::string body, out;
};

/// Beside what is at `out`, whose name it takes when it is whole.
void write_in_place(const std::filesystem::path& out, const ModalData& modes) {
  const std::filesystem::path before = name_before(out);
  std::string why;
  std::error_code error;
  try {
    write_modal_file(before, modes);
    std::filesystem::rename(before, out, error);
    if (!error) return;
    why = error.message();
  } catch (const InputError& e) {
    why = e.diagnostics().front().got;
  } catch (const NumericsError& e) {  // of HDF5
    why = e.failure().what;
  }
  std::filesystem::remove(before, error);
  throw WriteError(Diagnostic{Code::cannot_write, {{}, {out.string()}}, "a file that can be written", why});
}

int write_modes(const ModesArguments& a) {
  const ScenarioOptions options = a.scenario.options();
  const std::string ending = options.file.extension().string();
  const auto s = ending == ".yaml" || ending == ".yml" ? open_vehicle(options) : open_scenario(options);
  const ModalData* modes = nullptr;
  std::vector<std::string> legal;
  for (const BodySpec& body : s->model->spec->bodies) {
    if (!body.modal) continue;
    legal.push_back(body.name);
    if (body.name == a.body) modes = body.modal->whole ? body.modal->whole.get() : body.modal.get();
  }
  if (!modes)
    refuse(Code::unknown_body, {"body"},
           legal.empty() ? "a vehicle with a flexible body" : fmt::format("a flexible body: {}", fmt::join(legal, ", ")), in_quotes(a.body),
           did_you_mean(a.body, legal));
  const std::string out = a.out.empty() ? a.body + ".h5" : a.out;
  std::error_code ignored;
  if (std::filesystem::exists(out, ignored) && !std::filesystem::is_regular_file(out, ignored))
    refuse(Code::cannot_write, {"", {out}}, "a file", "a folder, a pipe or a device", "--out chooses another");
  expect_another_file(out, options.file);
  write_in_place(out, *modes);
  fmt::print("{}\n{} modes, {:.6g} kg, {} nodes, {} mass nodes\n", modes->source, modes->n_modes, modes->integrals.I1, modes->nodes.size(),
             modes->mass_nodes.size());
  for (int k = 0; k < modes->n_modes; ++k)
    fmt::print("  mode {:<4}{:>12.6g} Hz\n", k + 1, std::sqrt(modes->K(k, k) / modes->integrals.I6(k, k)) / (2 * std::numbers::pi));
  fmt::print("{}\n", out);
  return 0;
}

}  // namespace

void add_modes(CommandLine& line) {
  Command& command = line.command("modes", "Write the modes of a flexible body as a modal file");
  auto a = std::make_shared<ModesArguments>();
  a->scenario.add_to(command, line, "The scenario: a Lua file, or a folder with scenario.lua; or a vehicle: a YAML file");
  command.option("body", a->body, "The flexible body").required().type_name("BODY");
  command.option("--out", a->out, "The modal file; default: BODY.h5").type_name("FILE");
  command.action([a] { return write_modes(*a); });
}

}  // namespace cardan
