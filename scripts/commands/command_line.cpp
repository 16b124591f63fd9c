#include "scripts/commands/command_line.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <limits>

#include "core/base/units.hpp"

namespace cardan {

namespace {
/// A number that an option cannot take is told as other wrong values are. CLI11, which reads it next, would take -3 for 2^64 - 3, and 010
/// for 8.
template <class T>
CLI::Option* number(CLI::Option* option, const std::string& expected, T least, T most, const std::string& range = {}) {
  const auto read = [=](const std::string& word) {
    T value{};
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    const bool whole = error == std::errc{} && end == word.data() + word.size();
    if (!parse_number(word) || (std::is_integral_v<T> && !whole) || value < least || value > most)
      refuse(Code::command_line, {option->get_name()}, expected, in_quotes(word));
    return std::string();
  };
  return option->check(read, range);
}
template <class T>
CLI::Option* number(CLI::Option* option, const std::string& expected) {
  return number(option, expected, std::numeric_limits<T>::lowest(), std::numeric_limits<T>::max());
}
}  // namespace

Argument& Argument::type_name(const char* type) {
  option_->type_name(type);
  return *this;
}
Argument& Argument::required(bool is) {
  option_->required(is);
  return *this;
}
Argument& Argument::between(int least, int most) {
  const std::string range = fmt::format("{} to {}", least, most);
  number(option_, "a whole number from " + range, least, most, range);
  return *this;
}
Argument& Argument::split_at_commas() {
  option_->delimiter(',');
  return *this;
}

namespace {
/// An option is not to be empty: a variable that a shell does not know. Words by their place are answered by their command.
CLI::Option* filled(CLI::Option* option) {
  if (!option->get_positional())
    option->check([](const std::string& word) { return word.empty() ? "an empty word where a value is expected" : std::string(); });
  return option;
}
}  // namespace

Argument Command::option(const char* names, std::string& value, const char* what) {
  return Argument(*filled(app_->add_option(names, value, what)));
}
Argument Command::option(const char* names, std::vector<std::string>& value, const char* what) {
  return Argument(*filled(app_->add_option(names, value, what)->allow_extra_args(false)));
}
Argument Command::option(const char* names, int& value, const char* what) { return Argument(*app_->add_option(names, value, what)); }
Argument Command::option(const char* names, std::uint64_t& value, const char* what) {
  return Argument(*number<std::uint64_t>(app_->add_option(names, value, what), "a whole number from 0 to 18446744073709551615"));
}
Argument Command::option(const char* names, double& value, const char* what) {
  return Argument(*number<double>(app_->add_option(names, value, what), "a number"));
}
Argument Command::option(const char* names, std::optional<double>& value, const char* what) {
  return Argument(*number<double>(app_->add_option(names, value, what), "a number"));
}
void Command::flag(const char* names, bool& value, const char* what) { app_->add_flag(names, value, what); }

std::string Command::name() const { return app_->get_name(); }
std::string Command::what() const { return app_->get_description(); }
std::string Command::help() const { return app_->help("cardan"); }

std::vector<DeclaredArgument> Command::arguments() const {
  std::vector<DeclaredArgument> all;
  for (const CLI::Option* option : std::as_const(*app_).get_options()) {
    DeclaredArgument& a = all.emplace_back();
    for (const std::string& name : option->get_snames()) a.names.push_back("-" + name);
    for (const std::string& name : option->get_lnames()) a.names.push_back("--" + name);
    a.type = option->get_type_name(), a.what = option->get_description();
    a.required = option->get_required(), a.takes_value = option->get_items_expected_max() > 0;
  }
  return all;
}

CommandLine::CommandLine(std::vector<std::string> words)
    : words_(std::move(words)),
      json_errors_(std::ranges::find(words_, "--json-errors") != words_.end()),
      app_(std::make_unique<CLI::App>("Simulator of spacecraft made of rigid and flexible bodies", "cardan")) {
  app_->require_subcommand(0, 1);  // further words are arguments of the command, also where they name another
}
CommandLine::~CommandLine() = default;

Command& CommandLine::command(const char* name, const char* what) {
  return *commands_.emplace_back(std::make_unique<Command>(*app_->add_subcommand(name, what)));
}
void CommandLine::option_alone(const char* name, std::function<int()> action, const char* what) {
  app_->add_flag_callback(
      name, [this, action = std::move(action)] { alone_ = action; }, what);
}

std::vector<const Command*> CommandLine::commands() const {
  std::vector<const Command*> all;
  for (const auto& command : commands_) all.push_back(command.get());
  return all;
}

std::function<int()> CommandLine::read(std::function<int()> overview) {
  for (const auto& command : commands_) command->flag("--json-errors", json_errors_, "Errors as JSON on standard error");
  expect_command(*this);
  const auto chosen = [this]() -> const Command* {
    const std::vector<CLI::App*> named = app_->get_subcommands();
    if (named.empty()) return nullptr;
    return std::ranges::find(commands_, named.front()->get_name(), [](const auto& c) { return c->name(); })->get();
  };
  try {
    std::vector<std::string> last_first(words_.rbegin(), words_.rend() - (words_.empty() ? 0 : 1));  // as CLI11 takes them
    app_->parse(last_first);
  } catch (const CLI::CallForHelp&) {
    const Command* command = chosen();
    if (!command) return overview;
    return [command] {
      fmt::print("{}", command->help());
      return 0;
    };
  } catch (const CLI::ParseError& error) {
    throw InputError(wrong_words(*this, chosen(), app_->remaining(true), error.what()));
  }
  if (alone_) return alone_;
  const Command* command = chosen();
  return command ? command->action() : overview;
}

}  // namespace cardan
