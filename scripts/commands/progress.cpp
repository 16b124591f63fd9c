#include "scripts/commands/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

#include "scripts/commands/streams.hpp"

namespace cardan {
namespace {

constexpr auto kBarPeriod = std::chrono::milliseconds(100);
constexpr auto kLinePeriod = std::chrono::seconds(10);
constexpr int kWidth = 30;  // characters of the bar

constexpr double kDay = 86400;     // [s]
constexpr double kLongWait = 600;  // [s] from here on the steps are shown: are they what was expected?

/// How long it takes yet.
std::string wait_text(double seconds) {
  if (!(seconds < 1000 * 365.25 * kDay)) return "more than 1000 years";
  if (seconds >= 2 * 365.25 * kDay) return fmt::format("{:.0f} years", seconds / (365.25 * kDay));
  if (seconds >= 2 * kDay) return fmt::format("{:.0f} days", seconds / kDay);
  const long s = static_cast<long>(seconds + 0.5);
  return s < 3600 ? fmt::format("{}:{:02}", s / 60, s % 60) : fmt::format("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60);
}

}  // namespace

Progress::Look progress_look(bool quiet) {
  return quiet ? Progress::Look::none : isatty(STDERR_FILENO) ? Progress::Look::bar : Progress::Look::lines;
}

Progress::Progress(Look look, double t_end) : look_(look), t_end_(t_end) {
  if (look_ == Look::lines) next_ += kLinePeriod;
}

double Progress::wall_s() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

std::string progress_text(double t, double t_end, double wall, double step) {
  // As many decimals of both as 1/10000 of the run has; what is less than that, and still moves, as a power of ten.
  const int decimals = std::clamp(4 - static_cast<int>(std::ceil(std::log10(t_end))), 0, 15);
  const bool hidden = t > 0.0 && t < t_end * 1e-4;
  const double rate = wall > 0 ? t / wall : 0.0, left = rate > 0 ? (t_end - t) / rate : HUGE_VAL;
  std::string text =
      fmt::format("t = {} of {} s   {:.3g} times real time   ", hidden ? fmt::format("{:.3e}", t) : fmt::format("{:.{}f}", t, decimals),
                  t_end < 1e15 ? fmt::format("{:.{}f}", t_end, decimals) : fmt::format("{:g}", t_end), rate);
  text += rate > 0 ? wait_text(left) + " left" : "? left";
  if (left > kLongWait && step > 0) text += fmt::format(", steps of {:.1e} s", step);
  return text;
}

void Progress::update(double t) {
  ++steps_;
  if (look_ == Look::none || Clock::now() < next_) return;
  next_ = Clock::now() + (look_ == Look::bar ? Clock::duration(kBarPeriod) : Clock::duration(kLinePeriod));
  const std::string text = progress_text(t, t_end_, wall_s(), (t - shown_t_) / static_cast<double>(steps_));
  shown_t_ = t, steps_ = 0;
  if (look_ == Look::lines) {
    complain(text + "\n");
  } else {
    const int filled = std::clamp(static_cast<int>(kWidth * t / t_end_), 0, kWidth);
    draw(fmt::format("\r\033[K[{:#<{}}{:.<{}}] {}", "", filled, "", kWidth - filled, text));
    shown_ = true;
  }
}

void Progress::clear() {
  if (!shown_) return;
  draw("\r\033[K");
  shown_ = false;
}

}  // namespace cardan
