#include "precompute/cache/sha256.h"

#include <array>
#include <fmt/format.h>
#include <fstream>
#include <new>
#include <openssl/evp.h>
#include <vector>

#include "common/core/error.h"

namespace exmat::precompute {
namespace {

EVP_MD_CTX* context_of(void* context) { return static_cast<EVP_MD_CTX*>(context); }

}  // namespace

void Sha256::Closer::operator()(void* context) const { EVP_MD_CTX_free(context_of(context)); }

Sha256::Sha256() : context_(EVP_MD_CTX_new()) {
  if (!context_ || EVP_DigestInit_ex(context_of(context_.get()), EVP_sha256(), nullptr) != 1) throw std::bad_alloc();
}

void Sha256::add(std::span<const std::byte> bytes) {
  EVP_DigestUpdate(context_of(context_.get()), bytes.data(), bytes.size());
}

std::uint64_t Sha256::add_file(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw InputError({file.string(), "", "a readable file", "none", "check the path"});
  std::vector<char> buffer(1 << 20);
  std::uint64_t bytes = 0;
  while (stream.read(buffer.data(), static_cast<std::streamsize>(buffer.size())), stream.gcount() > 0) {
    const auto count = static_cast<std::size_t>(stream.gcount());
    add(std::as_bytes(std::span(buffer.data(), count)));
    bytes += count;
  }
  return bytes;
}

std::string Sha256::digest() {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  EVP_DigestFinal_ex(context_of(context_.get()), digest.data(), &size);
  std::string text;
  for (unsigned i = 0; i < size; ++i) text += fmt::format("{:02x}", digest[i]);
  return text;
}

std::string sha256_of_file(const std::filesystem::path& file) {
  Sha256 hash;
  hash.add_file(file);
  return hash.digest();
}

}  // namespace exmat::precompute
