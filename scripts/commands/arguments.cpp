#include <fmt/format.h>

#include <charconv>
#include <cstdio>
#include <filesystem>
#include <new>
#include <optional>
#include <sstream>
#include <string_view>

#include "core/base/activity.hpp"
#include "core/base/units.hpp"
#include "core/io/json.hpp"
#include "core/io/result_folder.hpp"
#include "core/io/yaml_reader.hpp"
#include "scripts/commands/commands.hpp"
#include "scripts/commands/streams.hpp"
#include "scripts/mission/run_again.hpp"

namespace cardan {
namespace {

/// "slew_angle = 20 deg", spaces around both taken off; nothing where there is no key.
std::optional<Setting> setting_of(std::string_view text) {
  const auto trimmed = [](std::string_view word) {
    constexpr std::string_view kSpaces = " \t\r\n\v\f";
    const std::size_t begin = word.find_first_not_of(kSpaces), end = word.find_last_not_of(kSpaces);
    return std::string(begin == std::string_view::npos ? "" : word.substr(begin, end - begin + 1));
  };
  const std::size_t equals = text.find('=');
  if (equals == std::string_view::npos) return std::nullopt;
  Setting set{trimmed(text.substr(0, equals)), trimmed(text.substr(equals + 1))};
  return set.key.empty() ? std::nullopt : std::optional(std::move(set));
}

}  // namespace

Argument ScenarioArguments::add_to(Command& command, const CommandLine& line, const char* what, const char* type, const char* of_seed) {
  to = &line;
  Argument argument = command.option("file", file, what);
  argument.required().type_name(type);
  command
      .option("--set", settings, "Override a value: slew_angle=\"20 deg\", vehicle.bodies.bus.mass=\"1700 kg\", mission.duration=\"50 s\"")
      .type_name("KEY=VALUE");
  command
      .option("--settings", settings_files,
              "The same from a file, key=value in each line; # begins a comment. What --set says comes after it")
      .type_name("FILE");
  command.option("--seed", seed, of_seed).type_name("N");
  return argument;
}

ScenarioOptions ScenarioArguments::options() const {
  ScenarioOptions o;
  o.file = file;
  if (!seed.empty()) {
    const auto number = parse_seed(seed);
    if (!number) refuse(Code::command_line, {"--seed"}, "a whole number from 0 to 18446744073709551615", in_quotes(seed));
    o.seed = *number;
  }
  if (!to || !to->json_errors()) o.print = [](std::string_view text) { complain(fmt::format("{}\n", text)); };
  for (const std::string& from : settings_files) {
    std::istringstream lines(read_text_file(from));
    int number = 0;
    for (std::string text; std::getline(lines, text);) {
      if (++number == 1 && text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);  // the byte-order mark of some editors
      if (text.ends_with('\r')) text.pop_back();
      text.erase(0, text.find_first_not_of(" \t"));
      if (text.empty() || text[0] == '#') continue;
      const auto set = setting_of(text);
      if (!set)
        refuse(Code::command_line, {"--settings", {from, number, 1}}, "key=value", in_quotes(text), "mission.integrator.relative=1e-8");
      o.settings.push_back(*set);
    }
  }
  for (const std::string& text : settings) {
    const auto set = setting_of(text);
    if (!set) refuse(Code::command_line, {"--set"}, "key=value", in_quotes(text), "--set slew_angle=\"20 deg\"");
    o.settings.push_back(*set);
  }
  return o;
}

std::pair<std::size_t, std::size_t> shard_of(const std::string& text) {
  if (text.empty()) return {1, 1};
  std::size_t i = 0, n = 0;
  const auto slash = text.find('/');
  const char* const end = text.data() + text.size();
  const bool read = slash != std::string::npos && std::from_chars(text.data(), text.data() + slash, i).ptr == text.data() + slash &&
                    std::from_chars(text.data() + slash + 1, end, n).ptr == end;
  if (!read || i < 1 || i > n) refuse(Code::command_line, {"--shard"}, "i/n with i from 1 to n: 2/3", in_quotes(text));
  return {i, n};
}

int report_error(const std::exception& error, bool as_json, int wrong_input) {
  const auto tell = [&](int code, const std::string& text, Json errors) {
    if (as_json)
      complain(json_text({{"exit_code", code}, {"errors", std::move(errors)}}));
    else
      complain(text);
    return code;
  };
  if (const auto* unwritten = dynamic_cast<const WriteError*>(&error)) return report_unwritten(unwritten->diagnostics(), as_json);
  if (const auto* input = dynamic_cast<const InputError*>(&error)) {
    Json all = Json::array();
    for (const Diagnostic& d : input->diagnostics()) all.push_back(to_json(d));
    return tell(wrong_input, input->what(), std::move(all));
  }
  if (const auto* numerics = dynamic_cast<const NumericsError*>(&error))
    return tell(3, numerics->what(), Json::array({to_json(numerics->failure())}));
  if (dynamic_cast<const std::bad_alloc*>(&error)) {
    const std::string& what = Activity::ended();
    return report_error(
        InputError(Diagnostic{
            Code::no_memory, {}, {}, what.empty() ? "" : "no memory for " + what, "a smaller input, or a larger limit (ulimit -v)"}),
        as_json, wrong_input);
  }
  if (const auto* place = dynamic_cast<const std::filesystem::filesystem_error*>(&error))  // as where the current folder is gone
    return report_error(InputError(Diagnostic{
                            Code::file_not_found, {{}, {place->path1().string()}}, "a place that can be reached", place->code().message()}),
                        as_json, wrong_input);
  return tell(
      70, fmt::format("internal error: {}\nThis is a fault of Cardan. Please report it with this text and the scenario.\n", error.what()),
      Json::array({{{"title", "internal error"}, {"what", error.what()}}}));
}

void write_result(const std::filesystem::path& file, std::string_view text, std::vector<Diagnostic>& unwritten) {
  try {
    write_whole_file(file, text);
  } catch (const WriteError& e) {
    unwritten.push_back(e.diagnostics().front());
  }
}

int report_unwritten(std::vector<Diagnostic> unwritten, bool as_json, int code) {
  if (code == 0 && !unwritten.empty()) code = kNotWritten;
  if (as_json && !unwritten.empty()) return report_error(InputError(std::move(unwritten)), true, code);
  for (const Diagnostic& d : unwritten) complain(render(d) + "\n");
  return code;
}

}  // namespace cardan
