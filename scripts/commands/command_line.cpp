// Answers to command lines that cannot be understood.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "core/base/units.hpp"
#include "scripts/commands/commands.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> commands_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) names.push_back(command->get_name());
  return names;
}

std::vector<std::string> options_of(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    for (const std::string& name : option->get_snames()) names.push_back("-" + name);
  }
  return names;
}

/// The only legal word that begins with `word` (of three characters or more), or else one that is spelt like it.
std::string near_word(const std::string& word, const std::vector<std::string>& legal) {
  const auto begins = [&](const std::string& name) { return name.starts_with(word); };
  if (word.size() >= 3 && std::ranges::count_if(legal, begins) == 1)
    return fmt::format("did you mean \"{}\"?", *std::ranges::find_if(legal, begins));
  return did_you_mean(word, legal);
}

/// The command that takes a file like this one; empty if none does.
std::string command_for(const std::string& word) {
  const fs::path path(word);
  const std::string ending = path.extension().string();
  std::error_code ignored;
  if (ending == ".lua" || fs::is_directory(path, ignored)) return "run";
  if (ending == ".yaml" || ending == ".yml") return "workbench";
  if (ending == ".h5") return "report";
  if (ending == ".urdf") return "import";
  if (ending == ".so") return "check-plugin";
  return {};
}

}  // namespace

void expect_command(const CLI::App& app, const std::vector<std::string>& arguments) {
  if (arguments.empty() || arguments[0].starts_with('-')) return;
  const std::string& word = arguments[0];
  const std::vector<std::string> names = commands_of(app);
  if (std::ranges::find(names, word) != names.end()) return;
  const std::string command = command_for(word);
  refuse(Code::command_line, {}, fmt::format("a command: {}", fmt::join(names, ", ")), in_quotes(word),
         command.empty() ? near_word(word, names) : fmt::format("did you mean \"cardan {} {}\"?", command, word));
}

Diagnostic wrong_command_line(const CLI::App& app, const CLI::ParseError& error) {
  const auto chosen = app.get_subcommands();
  const CLI::App& command = chosen.empty() ? app : *chosen.front();
  const std::string called = chosen.empty() ? "cardan" : "cardan " + command.get_name();
  const std::string more = chosen.empty() ? "cardan help" : "cardan help " + command.get_name();
  const std::vector<std::string> rest = app.remaining(true), legal = options_of(command);
  const auto is_option = [](const std::string& word) { return word.size() > 1 && word[0] == '-' && word != "--"; };
  if (const auto unknown = std::ranges::find_if(rest, is_option); unknown != rest.end()) {
    const std::string name = unknown->substr(0, unknown->find('='));
    std::string hint = near_word(name, legal);
    if (hint.empty()) {
      std::vector<std::string> others;
      for (const CLI::App* other : app.get_subcommands([](const CLI::App*) { return true; })) {
        const auto names = options_of(*other);
        if (name != "--help" && name != "-h" && std::ranges::find(names, name) != names.end()) others.push_back(other->get_name());
      }
      if (!others.empty())
        hint = fmt::format("an option of {}{}", fmt::join(others, ", "), chosen.empty() ? "; options follow the command" : "");
    }
    return Diagnostic{Code::command_line,
                      {},
                      fmt::format("an option of {}: {}", called, fmt::join(legal, ", ")),
                      in_quotes(name),
                      hint.empty() ? more : hint};
  }
  if (!rest.empty()) return Diagnostic{Code::command_line, {}, fmt::format("nothing more for {}", called), in_quotes(rest.front()), more};
  return Diagnostic{Code::command_line, {}, {}, error.what(), more};
}

}  // namespace cardan
