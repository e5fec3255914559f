// Stands in for libFuzzer: runs a target on a corpus and on simple mutations of it, always the same ones.
//   exmat_fuzz_NAME CORPUS_FOLDER MUTATIONS
// What the target lets escape ends the program, as does asking for more than kMostMemory.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <sys/resource.h>
#include <vector>

#include "tests/fuzz/fuzz_target.h"

#ifdef __SANITIZE_ADDRESS__
// Functions of sanitizer/allocator_interface.h, which not every GCC has beside it.
extern "C" std::size_t __sanitizer_get_current_allocated_bytes();
extern "C" int __sanitizer_install_malloc_and_free_hooks(void (*allocated)(const volatile void*, std::size_t),
                                                         void (*freed)(const volatile void*));
#endif

namespace {

constexpr std::size_t kMostMemory = std::size_t{1} << 30;  // of address space [bytes]

class Mutator {
 public:
  explicit Mutator(const std::vector<std::string>& corpus) : corpus_(corpus) {}

  std::string next() {
    std::string text = corpus_[below(corpus_.size())];
    for (std::size_t changes = 1 + below(4); changes > 0; --changes) change(text);
    return text;
  }

 private:
  std::size_t below(std::size_t count) { return std::uniform_int_distribution<std::size_t>(0, count - 1)(random_); }

  void change(std::string& text) {
    const std::size_t at = below(text.size() + 1), length = std::min(below(16) + 1, text.size() - at);
    const std::string& other = corpus_[below(corpus_.size())];
    const std::size_t from = below(other.size() + 1);
    static const std::vector<std::string> kNumbers = {"0",   "-1",   "99999999999",      "4294967295",          "1e999",
                                                      "nan", "-inf", "\xff\xff\xff\x7f", std::string(8, '\xff')};
    switch (below(6)) {
      case 0:
        if (at < text.size()) text[at] = static_cast<char>(text[at] ^ (1 << below(8)));
        return;
      case 1:
        text.erase(at, length);
        return;
      case 2:
        text.insert(at, text.substr(at, length));
        return;
      case 3:
        text.replace(at, length, other, from, length);
        return;
      case 4:
        text.replace(at, length, kNumbers[below(kNumbers.size())]);
        return;
      default:
        text.resize(at);
    }
  }

  const std::vector<std::string>& corpus_;
  std::mt19937_64 random_{1};
};

void run(const std::string& text) {
  LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
}

#ifdef __SANITIZE_ADDRESS__
void check_heap(const volatile void*, std::size_t size) {
  if (__sanitizer_get_current_allocated_bytes() <= kMostMemory) return;
  std::fprintf(stderr, "the heap is larger than %zu bytes, the last request %zu\n", kMostMemory, size);
  std::abort();
}

/// The sanitizer takes address space without end: here it is the heap, with what was freed lately, that is limited.
bool limit_memory() {
  return __sanitizer_install_malloc_and_free_hooks(check_heap, [](const volatile void*) {}) != 0;
}
#else
bool limit_memory() {
  const rlimit limit{kMostMemory, kMostMemory};
  return setrlimit(RLIMIT_AS, &limit) == 0;
}
#endif

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fputs("exmat_fuzz_NAME CORPUS_FOLDER MUTATIONS\n", stderr);
    return 2;
  }
  if (!limit_memory()) {
    std::fputs("cannot limit the memory\n", stderr);
    return 1;
  }
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(argv[1])) files.push_back(entry.path());
  std::ranges::sort(files);
  std::vector<std::string> corpus;
  for (const auto& file : files) {
    std::ifstream stream(file, std::ios::binary);
    corpus.emplace_back(std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>());
    run(corpus.back());
  }
  const long mutations = std::stol(argv[2]);
  Mutator mutator(corpus);
  for (long i = 0; i < mutations; ++i) run(mutator.next());
  std::printf("%zu inputs and %ld mutations\n", corpus.size(), mutations);
  return 0;
}
