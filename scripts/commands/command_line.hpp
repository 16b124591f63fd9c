#pragma once
// The command line of the program: commands with their arguments, declared here and told by help, manual page and completion. CLI11 reads
// the words; it is compiled once (command_line.cpp), as it takes four seconds in every file that names it.
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/diagnostic.hpp"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace cardan {

/// An argument that is being declared: what is said of it beside its names and what it is for.
class Argument {
 public:
  explicit Argument(CLI::Option& option) : option_(&option) {}
  Argument& type_name(const char* type);  // of its value, in help; completion offers what is of this type
  Argument& required(bool is = true);
  Argument& between(int least, int most);  // a number outside is refused
  Argument& split_at_commas();             // several values in one word

 private:
  CLI::Option* option_;
};

/// An argument as it was declared.
struct DeclaredArgument {
  std::vector<std::string> names;  // -j, --jobs; none if its place tells it
  std::string type, what;
  bool required = false, takes_value = false;
  bool positional() const { return names.empty(); }
};

class Command {
 public:
  explicit Command(CLI::App& app) : app_(&app) {}
  /// `names`: "-j,--jobs", or one word for an argument that its place tells. Its value goes to `value`, whose present one is the default;
  /// an option that fills a vector may be repeated. Whoever declares keeps `value` until the words are read.
  Argument option(const char* names, std::string& value, const char* what);
  Argument option(const char* names, std::vector<std::string>& value, const char* what);
  Argument option(const char* names, int& value, const char* what);
  Argument option(const char* names, std::uint64_t& value, const char* what);
  Argument option(const char* names, double& value, const char* what);
  Argument option(const char* names, std::optional<double>& value, const char* what);
  void flag(const char* names, bool& value, const char* what);
  /// What the command does; returns the exit code.
  void action(std::function<int()> action) { action_ = std::move(action); }
  const std::function<int()>& action() const { return action_; }

  std::string name() const;
  std::string what() const;  // it is for
  std::vector<DeclaredArgument> arguments() const;
  std::string help() const;  // of `cardan help NAME`

 private:
  CLI::App* app_;
  std::function<int()> action_;
};

class CommandLine {
 public:
  explicit CommandLine(std::vector<std::string> words);  // the name of the program first
  ~CommandLine();
  CommandLine(const CommandLine&) = delete;
  CommandLine& operator=(const CommandLine&) = delete;

  /// A new command. It takes --json-errors as every other.
  Command& command(const char* name, const char* what);
  /// An option without a command: `cardan --version`.
  void option_alone(const char* name, std::function<int()> action, const char* what);
  /// What the words ask for: the action of a command, its help, or `overview` without a command. Throws InputError C0801 for words that
  /// mean nothing, with what may be meant.
  std::function<int()> read(std::function<int()> overview);

  const std::vector<std::string>& words() const { return words_; }
  bool json_errors() const { return json_errors_; }
  std::vector<const Command*> commands() const;

 private:
  std::vector<std::string> words_;
  bool json_errors_ = false;
  std::unique_ptr<CLI::App> app_;
  std::vector<std::unique_ptr<Command>> commands_;
  std::function<int()> alone_;
};

/// Throws InputError C0801 with what may be meant, if the first word after the program is neither a command nor an option.
void expect_command(const CommandLine& line);
/// What is wrong with words that cannot be read, with what may be meant. `chosen`: the command, if it could be told; `rest`: the words that
/// nobody took; `why`: what CLI11 says.
Diagnostic wrong_words(const CommandLine& line, const Command* chosen, const std::vector<std::string>& rest, const std::string& why);

}  // namespace cardan
