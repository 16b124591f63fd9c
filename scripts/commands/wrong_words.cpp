// Answers to command lines that cannot be understood.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "core/base/units.hpp"
#include "scripts/commands/command_line.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> options_of(const Command& command) {
  std::vector<std::string> names;
  for (const DeclaredArgument& a : command.arguments()) names.insert(names.end(), a.names.rbegin(), a.names.rend());
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

void expect_command(const CommandLine& line) {
  if (line.words().size() < 2 || line.words()[1].starts_with('-')) return;
  const std::string& word = line.words()[1];
  std::vector<std::string> names;
  for (const Command* command : line.commands()) names.push_back(command->name());
  if (std::ranges::find(names, word) != names.end()) return;
  const std::string command = command_for(word);
  refuse(Code::command_line, {}, fmt::format("a command: {}", fmt::join(names, ", ")), in_quotes(word),
         command.empty() ? near_word(word, names) : fmt::format("did you mean \"cardan {} {}\"?", command, word));
}

Diagnostic wrong_words(const CommandLine& line, const Command* chosen, const std::vector<std::string>& rest, const std::string& why) {
  const std::string called = chosen ? "cardan " + chosen->name() : "cardan";
  const std::string more = chosen ? "cardan help " + chosen->name() : "cardan help";
  const std::vector<std::string> legal = chosen ? options_of(*chosen) : std::vector<std::string>{"--help", "-h", "--version"};
  const auto is_option = [](const std::string& word) { return word.size() > 1 && word[0] == '-' && word != "--"; };
  if (const auto unknown = std::ranges::find_if(rest, is_option); unknown != rest.end()) {
    const std::string name = unknown->substr(0, unknown->find('='));
    std::string hint = near_word(name, legal);
    if (hint.empty()) {
      std::vector<std::string> others;
      for (const Command* other : line.commands()) {
        const auto names = options_of(*other);
        if (name != "--help" && name != "-h" && std::ranges::find(names, name) != names.end()) others.push_back(other->name());
      }
      if (!others.empty()) hint = fmt::format("an option of {}{}", fmt::join(others, ", "), chosen ? "" : "; options follow the command");
    }
    return Diagnostic{Code::command_line,
                      {},
                      fmt::format("an option of {}: {}", called, fmt::join(legal, ", ")),
                      in_quotes(name),
                      hint.empty() ? more : hint};
  }
  if (!rest.empty()) return Diagnostic{Code::command_line, {}, fmt::format("nothing more for {}", called), in_quotes(rest.front()), more};
  std::string words;  // of the command: those by their place, and what it cannot be without
  for (const DeclaredArgument& a : chosen ? chosen->arguments() : std::vector<DeclaredArgument>()) {
    if (a.positional() || a.required) words += (a.positional() ? " " : " " + a.names.back() + " ") + a.type;
    for (const std::string& name : a.names) {  // CLI11 names an option before it says what is wrong with it
      if (a.takes_value && why.starts_with(name + ": ") && why.find(" required ") != std::string::npos)
        return Diagnostic{Code::command_line, {name}, "one value: " + a.type, why.ends_with(" missing") ? "none" : "several", more};
      const std::string value_of_flag = "Could not convert: " + name + " = ";
      if (!a.takes_value && why.starts_with(value_of_flag))
        return Diagnostic{Code::command_line, {name}, "no value", in_quotes(why.substr(value_of_flag.size())), more};
    }
  }
  constexpr std::string_view kMissing = " is required";
  if (why.ends_with(kMissing))
    return Diagnostic{Code::command_line, {}, called + words, "no " + why.substr(0, why.size() - kMissing.size()), more};
  return Diagnostic{Code::command_line, {}, {}, why, more};
}

}  // namespace cardan
