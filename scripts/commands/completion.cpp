// `cardan completion bash`: a script that completes commands, options and files, made from the declarations of the
// commands.
#include <fmt/format.h>

#include "bodies/register.hpp"
#include "core/abi/registry.hpp"
#include "core/base/units.hpp"
#include "core/model/hinge_load_types.hpp"
#include "hinges/register.hpp"
#include "plugins/devices/register.hpp"
#include "scripts/commands/commands.hpp"

namespace cardan {
namespace {

/// What completes an argument by its type name: words, endings of files, or folders.
std::string candidates(const CommandLine& line, const std::string& type) {
  if (type == "SCENARIO") return "_cardan_files lua";
  if (type == "SCENARIO|VEHICLE") return "_cardan_files lua yaml yml";
  if (type == "SCRIPT") return "_cardan_files lua";
  if (type == "RESULTS") return "_cardan_files h5";
  if (type == "PAGE") return "_cardan_files html";
  if (type == "ROBOT") return "_cardan_files urdf xml";
  if (type == "VEHICLE") return "_cardan_files yaml yml";
  if (type == "PLUGIN") return "_cardan_files so";
  if (type == "DIR") return "_cardan_files";
  std::string words;
  const auto add = [&](const std::string& word) { words += (words.empty() ? "" : " ") + word; };
  if (type == "SHELL") words = "bash zsh";
  if (type == "BASE") words = "free fixed";
  if (type == "KIND") words = "hinge body device field";
  if (type == "TYPE") {
    Registry registry;
    register_bodies(registry);
    register_devices(registry);
    register_hinges(registry);
    for (const auto& types : {registry.bodies.types(), registry.hinges.types()})
      for (const std::string& name : types) add(name);
    for (const HingeLoadType& load : kHingeLoadTypes) add(load.name);
  }
  if (type == "TOPIC") {
    for (const Command* command : line.commands()) add(command->name());
    for (const char* topic : {"errors", "man"}) add(topic);
    for (const Code code : kAllCodes) add(std::string(number_of(code)));
  }
  return words.empty() ? ":" : fmt::format("_cardan_words {}", words);
}

/// The branch of the script for one command: values of its options, its options, its argument.
std::string case_of(const CommandLine& line, const Command& command) {
  std::string flags, values, positional = ":";
  for (const DeclaredArgument& a : command.arguments()) {
    std::string names;
    for (const std::string& name : a.names) {
      if (!name.starts_with("--")) continue;
      flags += " " + name;
      names += (names.empty() ? "" : "|") + name;
    }
    if (a.positional()) positional = candidates(line, a.type);
    if (!names.empty() && a.takes_value) values += fmt::format("        {}) {}; return ;;\n", names, candidates(line, a.type));
  }
  return fmt::format(
      "    {})\n      case \"$previous\" in\n{}        *) ;;\n      esac\n"
      "      if [[ $current == -* ]]; then _cardan_words{}; else {}; fi ;;\n",
      command.name(), values, flags, positional);
}

std::string script(const CommandLine& line, bool zsh) {
  std::string commands, cases;
  for (const Command* command : line.commands()) {
    commands += " " + command->name();
    cases += case_of(line, *command);
  }
  std::string out = zsh ? "autoload -Uz +X compinit bashcompinit && compinit -u && bashcompinit\n" : "";
  out += R"(_cardan_words() { COMPREPLY=($(compgen -W "$*" -- "$current")); }
_cardan_files() {
  local IFS=$'\n' ending
  compopt -o filenames 2> /dev/null
  COMPREPLY=($(compgen -d -- "$current"))
  for ending in "$@"; do COMPREPLY+=($(compgen -f -X "!*.$ending" -- "$current")); done
}
_cardan() {
  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD-1]}
  COMPREPLY=()
)";
  out += fmt::format(
      "  if [ \"$COMP_CWORD\" -eq 1 ]; then _cardan_words{} --help --version; return; fi\n"
      "  case \"${{COMP_WORDS[1]}}\" in\n{}  esac\n}}\ncomplete -F _cardan cardan\n",
      commands, cases);
  return out;
}

}  // namespace

void add_completion(CommandLine& line) {
  Command& command = line.command("completion", "Print a script that completes command lines: eval \"$(cardan completion bash)\"");
  auto shell = std::make_shared<std::string>();
  command.option("shell", *shell, "bash or zsh").required().type_name("SHELL");
  command.action([&line, shell] {
    if (*shell != "bash" && *shell != "zsh") refuse(Code::command_line, {}, "bash or zsh", in_quotes(*shell));
    fmt::print("{}", script(line, *shell == "zsh"));
    return 0;
  });
}

}  // namespace cardan
