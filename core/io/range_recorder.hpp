#pragma once
// Least and largest value of what is recorded, its hashes, and how much of it there is.
#include <array>

#include "core/base/checkpoint.hpp"
#include "core/io/recorder.hpp"
#include "core/io/sha256.hpp"

namespace cardan {

/// Least and largest value of one recorded number over the rows; both NaN once it was NaN, least > largest without rows.
struct Range {
  std::string path, component, unit;
  double least, largest;
};

/// The block of a checkpoint that holds RangeRecorder::Counts.
inline constexpr const char* kRecorderCounts = "recorder";

/// A recorder that hands everything on to `recorder` and keeps the range of each number and a hash of each channel.
class RangeRecorder final : public Recorder {
 public:
  explicit RangeRecorder(Recorder& recorder) : recorder_(recorder) {}
  void begin(const RunHeader& header, const std::vector<Channel>& channels) override;
  void row(double t, std::span<const double> values) override;
  void note(Note kind, double t, const std::vector<std::string>& texts) override;
  void left_out(Note kind, std::size_t more) override;
  void steps(std::span<const double> numbers, const std::string& worst) override { ++counts_.intervals, recorder_.steps(numbers, worst); }
  void checkpoint(double t, const std::string& text) override { recorder_.checkpoint(t, text); }
  void attach(const std::string& name, const std::string& text) override { recorder_.attach(name, text); }
  void restart_state(double t, std::span<const double> x) override { recorder_.restart_state(t, x); }
  void flush() override { recorder_.flush(); }
  void close(std::string_view verdict) override { recorder_.close(verdict); }
  const std::vector<Range>& ranges() const { return ranges_; }
  /// By the path of each channel the SHA-256 of its rows so far, 8 bytes a number (IEEE 754, little-endian), as the dataset of run.h5 has
  /// them but that all NaN are the same; first that of the times, "time".
  std::vector<std::pair<std::string, std::string>> hashes() const;
  /// Rows, intervals of the history of steps, and notes of each kind so far.
  struct Counts {
    std::size_t rows = 0, intervals = 0;
    std::array<std::size_t, 4> notes{};  // by Note
    void remember(Archive& archive) { archive(rows, intervals, std::span(notes)); }
  };
  const Counts& counts() const { return counts_; }
  /// While true, notes go nowhere: they are known already.
  void set_deaf(bool deaf) { deaf_ = deaf; }

 private:
  Recorder& recorder_;
  std::vector<Range> ranges_;
  struct Hashed {
    std::string path;
    std::size_t numbers;  // per row
    Sha256 hash;
  };
  Sha256 times_;
  std::vector<Hashed> hashed_;
  std::vector<double> hashed_row_;
  Counts counts_;
  bool deaf_ = false;
};

}  // namespace cardan
