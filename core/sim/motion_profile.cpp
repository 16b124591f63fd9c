#include "core/sim/motion_profile.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/reference/quad.hpp"

namespace cardan {

MotionProfile MotionProfile::hold(double rate) { return rate_table({{0.0, rate}}); }

MotionProfile MotionProfile::rate_table(std::vector<std::pair<double, double>> points) {
  MotionProfile p;
  p.points_ = std::move(points);
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
  archive.finite(points_, amplitude_, frequency_, phase_);
  const auto not_later = [](const auto& a, const auto& b) { return a.first >= b.first; };
  if (std::ranges::adjacent_find(points_, not_later) != points_.end()) archive.wrong("a profile whose times do not increase");
}

namespace {
using Points = std::vector<std::pair<double, double>>;
/// Index of the first point after t.
template <class T>
std::size_t after(const Points& points, const T& t) {
  return static_cast<std::size_t>(std::ranges::upper_bound(points, t, std::less<>(), [](const auto& p) { return T(p.first); }) -
                                  points.begin());
}
}  // namespace

template <class T>
T MotionProfile::rate(const T& t) const {
  using std::cos;
  if (points_.empty()) {
    const double w = 2.0 * std::numbers::pi * frequency_;
    return T(amplitude_ * w) * cos(T(w) * t + T(phase_));
  }
  const std::size_t i = after(points_, t);
  if (i == 0) return T(points_.front().second);
  if (i == points_.size()) return T(points_.back().second);
  const auto &a = points_[i - 1], &b = points_[i];
  return T(a.second) + (T(b.second) - T(a.second)) * (t - T(a.first)) / (T(b.first) - T(a.first));
}

double MotionProfile::largest_rate(double t_0, double t_1) const {
  if (points_.empty()) return std::abs(amplitude_ * 2.0 * std::numbers::pi * frequency_);
  double largest = std::max(std::abs(rate(t_0)), std::abs(rate(t_1)));
  for (const auto& [t, x] : points_)
    if (t > t_0 && t < t_1) largest = std::max(largest, std::abs(x));
  return largest;
}

template <class T>
T MotionProfile::acceleration(const T& t, double since) const {
  using std::sin;
  if (points_.empty()) {
    const double w = 2.0 * std::numbers::pi * frequency_;
    return T(-amplitude_ * w) * T(w) * sin(T(w) * t + T(phase_));
  }
  const std::size_t i = after(points_, since);
  if (i == 0 || i == points_.size()) return T(0.0);
  return (T(points_[i].second) - T(points_[i - 1].second)) / (T(points_[i].first) - T(points_[i - 1].first));
}

template <class T>
T MotionProfile::travel(const T& from, const T& to) const {
  using std::sin;
  if (to < from) return -travel(to, from);
  if (points_.empty()) {
    const double w = 2.0 * std::numbers::pi * frequency_;
    if (w == 0.0) return T(0.0);
    const T amplitude = T(amplitude_ * w) / T(w);
    return amplitude * (sin(T(w) * to + T(phase_)) - sin(T(w) * from + T(phase_)));
  }
  T sum(0.0), at = from, rate_there = rate(from);
  const auto go_to = [&](const T& t, const T& rate_then) {
    sum += T(0.5) * (rate_there + rate_then) * (t - at);
    at = t, rate_there = rate_then;
  };
  for (std::size_t i = after(points_, from); i < points_.size() && T(points_[i].first) < to; ++i)
    go_to(T(points_[i].first), T(points_[i].second));
  go_to(to, rate(to));
  return sum;
}

double MotionProfile::next_corner(double t) const {
  const std::size_t i = after(points_, t);
  return i < points_.size() ? points_[i].first : std::numeric_limits<double>::infinity();
}

template double MotionProfile::rate(const double&) const;
template double MotionProfile::acceleration(const double&, double) const;
template double MotionProfile::travel(const double&, const double&) const;
template reference::Quad MotionProfile::rate(const reference::Quad&) const;
template reference::Quad MotionProfile::acceleration(const reference::Quad&, double) const;
template reference::Quad MotionProfile::travel(const reference::Quad&, const reference::Quad&) const;

}  // namespace cardan
