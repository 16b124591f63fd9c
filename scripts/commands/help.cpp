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

std::string usage(const Command& command) {
  std::string out = command.name() + " [OPTIONS]";
  for (const DeclaredArgument& a : command.arguments())
    if (a.positional()) out += a.required ? " " + a.type : " [" + a.type + "]";
  return out;
}

std::string argument_name(const DeclaredArgument& a) {
  if (a.positional()) return a.type;
  return fmt::format("{}{}{}", fmt::join(a.names, ", "), a.takes_value ? " " : "", a.takes_value ? a.type : "");
}

std::string manual(const CommandLine& line) {
  std::string out = fmt::format(".TH CARDAN 1 \"\" \"cardan {}\" \"User commands\"\n.SH NAME\ncardan \\- {}\n.SH SYNOPSIS\n",
                                version::kNumber, roff("simulator of spacecraft made of rigid and flexible bodies"));
  for (const Command* command : line.commands()) out += fmt::format(".B cardan {}\n.br\n", roff(usage(*command)));
  out += ".SH COMMANDS\n";
  for (const Command* command : line.commands()) {
    out += fmt::format(".SS {}\n{}.\n", roff(usage(*command)), roff(command->what()));
    for (const DeclaredArgument& a : command->arguments()) out += fmt::format(".TP\n.B {}\n{}\n", roff(argument_name(a)), roff(a.what));
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

int help(const CommandLine& line, const std::string& topic) {
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
  for (const Command* command : line.commands()) {
    if (command->name() == topic) {
      fmt::print("{}", command->help());
      return 0;
    }
    legal.push_back(command->name());
  }
  if (topic.empty())
    fmt::print("{}", overview(line));
  else if (topic == "errors")
    fmt::print("{}", codes_text());
  else if (topic == "man")
    fmt::print("{}", manual(line));
  else
    refuse(Code::command_line, {}, "a command, an error code like C0107, \"errors\" or \"man\"", in_quotes(topic),
           did_you_mean(std::isdigit(static_cast<unsigned char>(topic.back())) ? as_code : topic, legal));
  return 0;
}

}  // namespace

std::string overview(const CommandLine& line) {
  std::string out = fmt::format(
      "cardan {}: simulator of spacecraft made of rigid and flexible bodies\n\nusage: cardan COMMAND [ARGUMENTS]\n\n", version::kNumber);
  for (const Command* command : line.commands()) out += fmt::format("  {:<14}{}\n", command->name(), command->what());
  return out +
         "\nA scenario is a Lua file about a vehicle in YAML (README.md has a first one):\n\n"
         "  cardan check scenario.lua             is it right?\n"
         "  cardan describe scenario.lua          what is it made of?\n"
         "  cardan run scenario.lua --out out     results, and a page to look at: out/report.html\n"
         "  cardan workbench scenario.lua         a prompt on it\n\n"
         "cardan help COMMAND tells the options, cardan help C0107 what an answer means,\n"
         "cardan help man the manual page (cardan help man | man -l -).\n";
}

void add_help(CommandLine& line) {
  Command& command = line.command("help", "Explain a command or an error code; \"errors\" lists the codes, \"man\" is the manual page");
  auto topic = std::make_shared<std::string>();
  command.option("topic", *topic, "A command, an error code, \"errors\" or \"man\"").type_name("TOPIC");
  command.action([&line, topic] { return help(line, *topic); });
}

}  // namespace cardan
