// change_hdf5 PATH FIRST COUNT SEED...: the inputs FIRST ... FIRST + COUNT - 1 of a fuzzer, made of one of the seeds each through the
// interface of HDF5, to the standard output: 8 bytes with the size, then the bytes. A program of its own, and without sanitizers: version
// 1.10 of the library now and then loses its heap, or writes without end, while it makes one, and then this program ends early.
#include <sys/resource.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>

#include "tests/fuzz/hdf5_mutations.hpp"

namespace {

void limit(__rlimit_resource resource, rlim_t most) {
  const rlimit both{most, most};
  setrlimit(resource, &both);
}

std::string bytes_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  std::string bytes(in ? static_cast<std::size_t>(in.tellg()) : 0, '\0');
  in.seekg(0).read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return bytes;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 5) return 2;
  limit(RLIMIT_CPU, 60), limit(RLIMIT_AS, rlim_t{4} << 30), limit(RLIMIT_FSIZE, rlim_t{16} << 20), limit(RLIMIT_CORE, 0);
  const std::string path = argv[1];
  const std::vector<std::string> paths(argv + 4, argv + argc);
  std::vector<std::string> seeds;
  for (const std::string& seed : paths) seeds.push_back(bytes_of(seed));
  const std::uint64_t first = std::strtoull(argv[2], nullptr, 10), count = std::strtoull(argv[3], nullptr, 10);
  for (std::uint64_t i = first; i < first + count; ++i) {
    cardan::fuzz::Random random(i);
    std::ofstream(path, std::ios::binary) << random.of(seeds);
    cardan::fuzz::mutate_hdf5(path, random);
    const std::string made = bytes_of(path);
    const std::uint64_t size = made.size();
    std::fwrite(&size, sizeof size, 1, stdout);
    if (std::fwrite(made.data(), 1, made.size(), stdout) != made.size() || std::fflush(stdout) != 0) return 1;
  }
  return 0;
}
