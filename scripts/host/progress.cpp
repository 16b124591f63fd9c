#include "scripts/host/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace cardan {
namespace {

constexpr auto kBarPeriod = std::chrono::milliseconds(100);
constexpr auto kLinePeriod = std::chrono::seconds(10);
constexpr int kWidth = 30;  // characters of the bar

std::string clock_text(double seconds) {
  const long s = static_cast<long>(seconds + 0.5);
  return s < 3600 ? fmt::format("{}:{:02}", s / 60, s % 60)
                  : fmt::format("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60);
}

}  // namespace

Progress::Look progress_look(bool quiet) {
  return quiet ? Progress::Look::none : isatty(STDERR_FILENO) ? Progress::Look::bar : Progress::Look::lines;
}

Progress::Progress(Look look, double t_end) : look_(look), t_end_(t_end) {
  if (look_ == Look::lines) next_ += kLinePeriod;
}

double Progress::wall_s() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

std::string Progress::text(double t) const {
  const double wall = wall_s(), rate = wall > 0 ? t / wall : 0.0;
  return fmt::format("t = {:.1f} of {:g} s   {:.3g} times real time   {} left", t, t_end_, rate,
                     rate > 0 ? clock_text((t_end_ - t) / rate) : "?");
}

void Progress::update(double t) {
  if (look_ == Look::none || Clock::now() < next_) return;
  next_ = Clock::now() + (look_ == Look::bar ? Clock::duration(kBarPeriod) : Clock::duration(kLinePeriod));
  if (look_ == Look::lines) {
    fmt::print(stderr, "{}\n", text(t));
  } else {
    const int filled = std::clamp(static_cast<int>(kWidth * t / t_end_), 0, kWidth);
    fmt::print(stderr, "\r\033[K[{:#<{}}{:.<{}}] {}", "", filled, "", kWidth - filled, text(t));
    shown_ = true;
  }
  std::fflush(stderr);
}

void Progress::print(std::string_view line) {
  clear();
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

void Progress::clear() {
  if (!shown_) return;
  fmt::print(stderr, "\r\033[K");
  std::fflush(stderr);
  shown_ = false;
}

}  // namespace cardan
