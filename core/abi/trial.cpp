#include "core/abi/trial.hpp"

#include <fmt/format.h>
#include <signal.h>

#include <cstring>
#include <exception>

namespace cardan {
namespace {

/// The child says a letter, and the phase up to the end of the line.
enum Said : char { phase = 'p', returned = 'r', threw = 't' };

std::string story(const ChildEnd& end, char last, const ChildLimits& limits) {
  switch (end.how) {
    case ChildEnd::How::late:
      return fmt::format("no answer within {:g} s", limits.wall_s);
    case ChildEnd::How::killed:
      return end.status == SIGXCPU || end.status == SIGKILL ? fmt::format("no end within {:g} s of computing", limits.cpu_s)
                                                            : strsignal(end.status);
    case ChildEnd::How::ended:
      if (last == threw) return "an exception that is no std::exception";
      return last == returned ? "" : "the process was ended (exit)";
    default:
      return "";
  }
}

}  // namespace

std::optional<std::string> end_in_child(const std::function<void(const TellPhase&)>& work, const ChildLimits& limits) {
  const ChildEnd end = run_in_child(
      [&](const Say& say) {
        const auto tell = [&](Said what, std::string_view text = "") { say(fmt::format("{}{}\n", static_cast<char>(what), text)); };
        try {
          work([&](std::string_view text) { tell(phase, text); });
          tell(returned);
        } catch (const std::exception&) {
          tell(returned);
        } catch (...) {
          tell(threw);
        }
      },
      limits);
  char last = phase;
  std::string_view said = end.said, in;
  for (std::size_t size; (size = said.find('\n')) != said.npos && size > 0; said.remove_prefix(size + 1)) {
    last = said[0];
    if (last == phase) in = said.substr(1, size - 1);
  }
  std::string how = story(end, last, limits);
  if (how.empty()) return {};
  if (!in.empty()) how += fmt::format(", in {}", in);
  return how;
}

}  // namespace cardan
