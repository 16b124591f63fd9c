// `cardan help`: the overview, a command, an error code, all codes, or the manual page; all from what the program holds
// already.
#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "core/base/units.hpp"
#include "core/base/version.hpp"
#include "scripts/commands/commands.hpp"
#include "scripts/commands/documents.hpp"

namespace cardan {
namespace {

constexpr std::size_t kTextWidth = 80;

std::vector<const CLI::App*> subcommands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

/// Words of a paragraph in lines of at most kTextWidth characters.
std::string wrapped(const std::string& text) {
  std::istringstream words(text);
  std::string out, line;
  for (std::string word, more; words >> word;) {
    while (std::ranges::count(word, '`') % 2 == 1 && words >> more) word += " " + more;  // `N m/rad` stays whole
    if (!line.empty() && line.size() + 1 + word.size() > kTextWidth) out += std::exchange(line, "") + "\n";
    line += (line.empty() ? "" : " ") + word;
  }
  return out + line + (line.empty() ? "" : "\n");
}

/// The section of docs/errors.md on a code: its heading and its paragraphs.
std::string error_text(Code code) {
  std::istringstream document{std::string(documents::errors())};
  std::string out, paragraph, line;
  bool inside = false;
  const auto finish = [&] { out += paragraph.empty() ? "" : "\n" + wrapped(std::exchange(paragraph, "")); };
  while (std::getline(document, line)) {
    if (line.starts_with("#")) {
      if (inside) break;
      inside = line.starts_with(fmt::format("## {} ", number_of(code)));
      if (inside) out = line.substr(3) + "\n";
    } else if (inside) {
      if (line.empty()) finish();
      paragraph += line + "\n";
    }
  }
  finish();
  return out;
}

std::string codes_text() {
  std::string out;
  for (const Code code : kAllCodes) out += fmt::format("{}  {}\n", number_of(code), title_of(code));
  return out + "\nC: the input is wrong, N: the numbers failed, W: a warning. cardan help C0107 tells more about one.\n";
}

// ---- the manual page ----

std::string roff(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '-' ? "\\-" : c == '\\' ? "\\e" : std::string(1, c);
  return out.starts_with('.') || out.starts_with('\'') ? "\\&" + out : out;
}

std::string usage(const CLI::App& command) {
  std::string out = command.get_name() + " [OPTIONS]";
  for (const CLI::Option* option : command.get_options())
    if (option->get_positional()) out += option->get_required() ? " " + option->get_type_name() : " [" + option->get_type_name() + "]";
  return out;
}

std::string option_name(const CLI::Option& option) {
  std::string out;
  for (const std::string& name : option.get_snames()) out += (out.empty() ? "-" : ", -") + name;
  for (const std::string& name : option.get_lnames()) out += (out.empty() ? "--" : ", --") + name;
  if (option.get_positional())
    out = option.get_type_name();
  else if (option.get_items_expected_max() > 0)
    out += " " + option.get_type_name();
  return out;
}

std::string manual(const CLI::App& app) {
  std::string out = fmt::format(".TH CARDAN 1 \"\" \"cardan {}\" \"User commands\"\n.SH NAME\ncardan \\- {}\n.SH SYNOPSIS\n",
                                version::kNumber, roff("simulator of spacecraft made of rigid and flexible bodies"));
  for (const CLI::App* command : subcommands_of(app)) out += fmt::format(".B cardan {}\n.br\n", roff(usage(*command)));
  out += ".SH COMMANDS\n";
  for (const CLI::App* command : subcommands_of(app)) {
    out += fmt::format(".SS {}\n{}.\n", roff(usage(*command)), roff(command->get_description()));
    for (const CLI::Option* option : command->get_options())
      out += fmt::format(".TP\n.B {}\n{}\n", roff(option_name(*option)), roff(option->get_description()));
  }
  out += ".SH EXIT STATUS\n";
  for (const auto& [code, meaning] : {std::pair{"0", "done"},
                                      {"1", "done, and an acceptance check of the scenario failed"},
                                      {"2", "the input is wrong, the command line included; nothing was run"},
                                      {"3", "the numbers failed during the run"},
                                      {"70", "a fault of Cardan"}})
    out += fmt::format(".TP\n.B {}\n{}\n", code, meaning);
  out += ".SH ERRORS AND WARNINGS\nMore about one by\n.BR \"cardan help\" \" CODE.\"\n";
  for (const Code code : kAllCodes) out += fmt::format(".TP\n.B {}\n{}\n", number_of(code), roff(std::string(title_of(code))));
  return out;
}

int help(const CLI::App& app, const std::string& topic) {
  std::vector<std::string> legal{"errors", "man"};
  std::string as_code = topic;
  std::ranges::transform(as_code, as_code.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  for (const Code code : kAllCodes) {
    if (number_of(code) == as_code) {
      fmt::print("{}", error_text(code));
      return 0;
    }
    legal.emplace_back(number_of(code));
  }
  for (const CLI::App* command : subcommands_of(app)) {
    if (command->get_name() == topic) {
      fmt::print("{}", command->help("cardan"));
      return 0;
    }
    legal.push_back(command->get_name());
  }
  if (topic.empty())
    fmt::print("{}", overview(app));
  else if (topic == "errors")
    fmt::print("{}", codes_text());
  else if (topic == "man")
    fmt::print("{}", manual(app));
  else
    refuse(Code::command_line, {}, "a command, an error code like C0107, \"errors\" or \"man\"", in_quotes(topic),
           did_you_mean(std::isdigit(static_cast<unsigned char>(topic.back())) ? as_code : topic, legal));
  return 0;
}

}  // namespace

std::string overview(const CLI::App& app) {
  std::string out = fmt::format(
      "cardan {}: simulator of spacecraft made of rigid and flexible bodies\n\nusage: cardan COMMAND [ARGUMENTS]\n\n", version::kNumber);
  for (const CLI::App* command : subcommands_of(app)) out += fmt::format("  {:<14}{}\n", command->get_name(), command->get_description());
  return out +
         "\nA scenario is a Lua file about a vehicle in YAML (README.md has a first one):\n\n"
         "  cardan check scenario.lua             is it right?\n"
         "  cardan describe scenario.lua          what is it made of?\n"
         "  cardan run scenario.lua --out out     results, and a page to look at: out/report.html\n"
         "  cardan workbench scenario.lua         a prompt on it\n\n"
         "cardan help COMMAND tells the options, cardan help C0107 what an answer means,\n"
         "cardan help man the manual page (cardan help man | man -l -).\n";
}

void add_help(CLI::App& app, CommandLine& line) {
  auto* command = app.add_subcommand("help", "Explain a command or an error code; \"errors\" lists the codes, \"man\" is the manual page");
  auto topic = std::make_shared<std::string>();
  command->add_option("topic", *topic, "A command, an error code, \"errors\" or \"man\"")->type_name("TOPIC");
  command->add_flag("--json-errors", line.json_errors, "Errors as JSON on standard error");
  command->callback([&app, &line, topic] { line.action = [&app, topic] { return help(app, *topic); }; });
}

}  // namespace cardan
