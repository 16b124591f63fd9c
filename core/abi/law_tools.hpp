#pragma once
// What the executable laws of every kind of family share: a list of violations, arrays with guards around them, random parameters.
#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <map>
#include <random>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/abi/law_record.hpp"
#include "core/abi/param_values.hpp"
#include "core/abi/table_checks.hpp"
#include "core/abi/trial.hpp"

namespace cardan {

/// Bit for bit; an array of nothing has no address to compare at.
inline bool same_bits(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0);
}

/// The laws that are tried on a family: what broke them, each with its error, its limit and the sample; and a record of all.
class Violations {
 public:
  int sample = 0;
  std::string at;  ///< where that sample is, told behind its number

  /// A law in the order of the report; `untried`: why, should no sample come to it.
  void list(std::string_view law, std::string_view untried = "no sample came to it");
  /// `scale` is the size of what was subtracted, so that the limit is one of relative precision; `where` tells several numbers apart.
  void law(std::string_view name, double error, double limit, double scale = 0.0, std::string_view where = "");
  /// A law that holds or does not; `told`: the words for that, where its name is not enough.
  void law(std::string_view name, bool holds, std::string_view told = "");
  bool none() const { return found_.empty(); }
  /// False when there are so many that further samples are of no use.
  bool few() const { return found_.size() < 20; }
  /// The violations; the record goes to `record` if there is one.
  std::vector<std::string> take(LawRecord* record);

 private:
  TriedLaw& tried(std::string_view name);

  std::vector<std::string> found_;
  LawRecord record_;
  std::map<std::string, std::size_t, std::less<>> index_;
};

/// Laws of every kind.
inline constexpr const char* kPack = "random parameters are packed into the bytes that they are given";
inline constexpr const char* kAccepts = "some random samples are accepted";
inline constexpr const char* kWrites = "functions write what they are handed and no more";
inline constexpr const char* kLeaves = "arguments are left as they were";

/// n numbers that foreign code is handed to write into, from the beginning of a cache line on: no numbers before the call, guards on both
/// sides.
class Handed {
 public:
  explicit Handed(std::size_t n) : lines_((n + 2 * kGuard + 7) / 8), n_(n) {
    std::fill_n(data(), n, std::numeric_limits<double>::quiet_NaN());
    std::memset(data() - kGuard, kMark, kGuard * sizeof(double));
    std::memset(data() + n, kMark, kGuard * sizeof(double));
  }
  double* data() { return reinterpret_cast<double*>(lines_.data()) + kGuard; }
  const double* data() const { return reinterpret_cast<const double*>(lines_.data()) + kGuard; }
  bool intact() const {
    const auto marked = [](const double* from) {
      const auto* bytes = reinterpret_cast<const unsigned char*>(from);
      for (std::size_t i = 0; i < kGuard * sizeof(double); ++i)
        if (bytes[i] != kMark) return false;
      return true;
    };
    return marked(data() - kGuard) && marked(data() + n_);
  }
  Eigen::Map<const Eigen::VectorXd> vector() const { return {data(), static_cast<Eigen::Index>(n_)}; }

 private:
  struct alignas(64) Line {
    double numbers[8];
  };
  static constexpr std::size_t kGuard = 64;  // whole lines
  static constexpr unsigned char kMark = 0xA5;
  std::vector<Line> lines_;
  std::size_t n_;
};

/// n numbers between -1 and 1.
Eigen::VectorXd random_vector(std::mt19937_64& rng, Eigen::Index n);

/// A set of parameters inside of their ranges (between 0.3 and 1 where there is none). `orthonormal`: lists of up to three vectors
/// are. `sparse`: what has a fallback takes it. `whole`: numbers in tables are.
ParamTable random_parameters(std::span<const cardan_param_desc> schema, std::mt19937_64& rng, bool orthonormal, bool sparse,
                             bool whole = false);

/// An instance packed at random: by random parameters, with orthonormal vectors, or as sparse as may be; the first set that pack accepts.
struct PackedSample {
  std::vector<double> block;
  std::size_t bytes = 0;
  std::string fault;  // it wrote beyond its bytes, or wants too many
};
/// `size` tells the bytes, `pack` fills them. Empty block: every set was refused.
PackedSample packed_at_random(std::span<const cardan_param_desc> schema, std::uint64_t seed,
                              const std::function<std::uint64_t(const cardan_param_values*)>& size,
                              const std::function<int(const cardan_param_values*, void*)>& pack);

/// Of a family whose pack may be null and whose size need not depend on the parameters; `before` is told what is called.
template <class Family>
PackedSample packed_at_random(const Family& f, std::uint64_t seed, const TellPhase& before) {
  PackedSample packed = packed_at_random(
      {f.params, f.n_params}, seed,
      [&](const cardan_param_values* values) {
        before("packed_size");
        return f.packed_size ? f.packed_size(values) : f.params_size;
      },
      [&](const cardan_param_values* values, void* to) {
        before("pack");
        return f.pack ? f.pack(values, to) : 0;
      });
  if (packed.block.empty() && packed.fault.empty()) packed.fault = "pack refuses every set of random parameters";
  return packed;
}

/// The same call in another thread.
void in_another_thread(const std::function<void()>& call);

}  // namespace cardan
