#include "core/sim/motion_profile.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace cardan {

MotionProfile MotionProfile::hold(double rate) { return rate_table({{0.0, rate}}); }

MotionProfile MotionProfile::rate_table(std::vector<std::pair<double, double>> points) {
  MotionProfile p;
  p.points_ = std::move(points);
  p.travelled_.assign(p.points_.size(), 0.0);
  for (std::size_t i = 1; i < p.points_.size(); ++i) {
    const auto &a = p.points_[i - 1], &b = p.points_[i];
    p.travelled_[i] = p.travelled_[i - 1] + 0.5 * (a.second + b.second) * (b.first - a.first);
  }
  return p;
}

MotionProfile MotionProfile::sine(double amplitude, double frequency, double phase) {
  MotionProfile p;
  p.amplitude_ = amplitude;
  p.frequency_ = frequency;
  p.phase_ = phase;
  return p;
}

void MotionProfile::remember(Archive& archive) {
  archive.finite(points_, travelled_, amplitude_, frequency_, phase_);
  const auto not_later = [](const auto& a, const auto& b) { return a.first >= b.first; };
  if (travelled_.size() != points_.size() || std::ranges::adjacent_find(points_, not_later) != points_.end())
    archive.wrong("a profile whose times do not increase");
}

namespace {
// Index of the first point after t.
std::size_t after(const std::vector<std::pair<double, double>>& points, double t) {
  return static_cast<std::size_t>(std::upper_bound(points.begin(), points.end(), t, [](double x, const auto& p) { return x < p.first; }) -
                                  points.begin());
}
}  // namespace

double MotionProfile::rate(double t) const {
  if (points_.empty()) {
    const double w = 2.0 * std::numbers::pi * frequency_;
    return amplitude_ * w * std::cos(w * t + phase_);
  }
  const std::size_t i = after(points_, t);
  if (i == 0) return points_.front().second;
  if (i == points_.size()) return points_.back().second;
  const auto &a = points_[i - 1], &b = points_[i];
  return a.second + (b.second - a.second) * (t - a.first) / (b.first - a.first);
}

double MotionProfile::largest_rate(double t_0, double t_1) const {
  if (points_.empty()) return std::abs(amplitude_ * 2.0 * std::numbers::pi * frequency_);
  double largest = std::max(std::abs(rate(t_0)), std::abs(rate(t_1)));
  for (const auto& [t, x] : points_)
    if (t > t_0 && t < t_1) largest = std::max(largest, std::abs(x));
  return largest;
}

double MotionProfile::acceleration(double t, double since) const {
  if (points_.empty()) {
    const double w = 2.0 * std::numbers::pi * frequency_;
    return -amplitude_ * w * w * std::sin(w * t + phase_);
  }
  const std::size_t i = after(points_, since);
  if (i == 0 || i == points_.size()) return 0.0;
  return (points_[i].second - points_[i - 1].second) / (points_[i].first - points_[i - 1].first);
}

double MotionProfile::integral(double t) const {
  if (points_.empty()) return amplitude_ * std::sin(2.0 * std::numbers::pi * frequency_ * t + phase_);
  const std::size_t i = after(points_, t), before = i == 0 ? 0 : i - 1;
  return travelled_[before] + 0.5 * (points_[before].second + rate(t)) * (t - points_[before].first);
}

double MotionProfile::next_corner(double t) const {
  const std::size_t i = after(points_, t);
  return i < points_.size() ? points_[i].first : std::numeric_limits<double>::infinity();
}

}  // namespace cardan
