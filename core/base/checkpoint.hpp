#pragma once
// All that a run goes on from, as named blocks of numbers and texts. What writes a block is what reads it back, so that the two cannot
// differ: each object has one function remember(Archive&), which names its members once.
#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace cardan {

struct CheckpointBlock {
  std::vector<double> numbers;
  std::vector<std::string> texts;
  bool operator==(const CheckpointBlock&) const = default;
};
using Checkpoint = std::map<std::string, CheckpointBlock>;  // by names: "state", "integrator", "ledger"

/// A checkpoint does not fit what it is read into: damaged, or of another model. what(): "block ledger: 20 numbers wanted, 19 are there".
struct CheckpointFault : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Writes the values that it is given, or gives them back what was written, in the same order: archive.block("state")(t, rate, name).
class Archive {
 public:
  /// To write.
  Archive() = default;
  /// To read.
  explicit Archive(Checkpoint from) : checkpoint_(std::move(from)), reading_(true) {}

  bool reading() const { return reading_; }
  const Checkpoint& checkpoint() const { return checkpoint_; }

  /// The block that follows; each name once. CheckpointFault where there is none to be read, or the one before was not read to its end.
  Archive& block(const std::string& name) {
    finish();
    const auto found = checkpoint_.find(name);
    if (reading_ != (found != checkpoint_.end())) throw CheckpointFault("block " + name + (reading_ ? ": there is none" : ": twice"));
    name_ = name;
    block_ = reading_ ? &found->second : &checkpoint_[name];
    number_ = text_ = 0;
    return *this;
  }
  /// After the last one.
  void finish() const {
    if (reading_ && block_ && (number_ != block_->numbers.size() || text_ != block_->texts.size())) wrong("there is more than is wanted");
  }

  template <class... T>
  Archive& operator()(T&&... values) {
    (value(values), ...);
    return *this;
  }

  /// The same, each number finite.
  template <class... T>
  Archive& finite(T&&... values) {
    const std::size_t first = number_;
    (value(values), ...);
    for (std::size_t i = first; reading_ && i < number_; ++i)
      if (!std::isfinite(block_->numbers[i])) wrong("a number is not finite");
    return *this;
  }

  /// What was read is not what it may be.
  [[noreturn]] void wrong(const std::string& why) const { throw CheckpointFault("block " + name_ + ": " + why); }

 private:
  void value(double& x) {
    if (!reading_) return block_->numbers.push_back(x);
    if (number_ == block_->numbers.size()) wrong("a number is missing");
    x = block_->numbers[number_++];
  }
  /// Whole numbers up to 2^53, of those that the type has.
  template <std::integral T>
  void value(T& n) {
    constexpr double least = std::max(static_cast<double>(std::numeric_limits<T>::min()), -0x1p53);
    constexpr double most = std::min(static_cast<double>(std::numeric_limits<T>::max()), 0x1p53);
    double x = static_cast<double>(n);
    value(x);
    if (!(x >= least && x <= most && x == std::trunc(x))) wrong("a whole number is not one, or too large");
    n = static_cast<T>(x);
  }
  void value(std::string& text) {
    if (!reading_) return block_->texts.push_back(text);
    if (text_ == block_->texts.size()) wrong("a text is missing");
    text = block_->texts[text_++];
  }
  /// Of the size that it has: another one does not fit.
  template <class T, std::size_t kSize>
  void value(std::span<T, kSize> all) {
    std::size_t n = all.size();
    value(n);
    if (n != all.size()) wrong(std::to_string(all.size()) + " values wanted, " + std::to_string(n) + " are there");
    for (T& x : all) value(x);
  }
  /// Of any size.
  template <class T>
  void value(std::vector<T>& all) {
    std::size_t n = all.size();
    value(n);
    if (reading_ && n > block_->numbers.size() + block_->texts.size()) wrong("a list is longer than the block");
    all.resize(n);
    for (T& x : all) value(x);
  }
  template <class A, class B>
  void value(std::pair<A, B>& both) {
    value(both.first);
    value(both.second);
  }
  template <class T>
  requires requires(T& x, Archive& a) { x.remember(a); }
  void value(T& x) { x.remember(*this); }

  Checkpoint checkpoint_;
  bool reading_ = false;
  std::string name_;
  CheckpointBlock* block_ = nullptr;
  std::size_t number_ = 0, text_ = 0;  // read so far
};

}  // namespace cardan
