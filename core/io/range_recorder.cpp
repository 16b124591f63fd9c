#include "core/io/range_recorder.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/io/run_columns.hpp"

namespace cardan {

void RangeRecorder::begin(const RunHeader& header, const std::vector<Channel>& channels) {
  for (const Channel& c : channels) {
    const std::vector<std::string> units = units_of_components(c.unit, c.components.size());
    for (std::size_t i = 0; i < c.components.size(); ++i) ranges_.push_back({c.path, c.components[i], units[i], HUGE_VAL, -HUGE_VAL});
  }
  for (const Channel& c : channels) hashed_.push_back({c.path, c.components.size(), {}});
  recorder_.begin(header, channels);
}

void RangeRecorder::row(double t, std::span<const double> values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    Range& r = ranges_[i];
    r.least = std::isnan(values[i]) ? values[i] : std::min(r.least, values[i]);  // min(NaN, x) is NaN: it stays
    r.largest = std::isnan(values[i]) ? values[i] : std::max(r.largest, values[i]);
  }
  times_.add(&t, sizeof t);
  hashed_row_.assign(values.begin(), values.end());
  for (double& x : hashed_row_)
    if (std::isnan(x)) x = std::numeric_limits<double>::quiet_NaN();  // 0 / 0 has another sign than a NaN that was read back
  const double* next = hashed_row_.data();
  for (Hashed& h : hashed_) {
    h.hash.add(next, h.numbers * sizeof(double));
    next += h.numbers;
  }
  ++counts_.rows;
  recorder_.row(t, values);
}

void RangeRecorder::note(Note kind, double t, const std::vector<std::string>& texts) {
  if (deaf_) return;
  ++counts_.notes[static_cast<std::size_t>(kind)];
  recorder_.note(kind, t, texts);
}

void RangeRecorder::left_out(Note kind, std::size_t more) {
  counts_.notes[static_cast<std::size_t>(kind)] += more;
  recorder_.left_out(kind, more);
}

std::vector<std::pair<std::string, std::string>> RangeRecorder::hashes() const {
  std::vector<std::pair<std::string, std::string>> out{{"time", times_.digest()}};
  for (const Hashed& h : hashed_) out.emplace_back(h.path, h.hash.digest());
  return out;
}

}  // namespace cardan
