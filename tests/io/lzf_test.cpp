// Unpacking piece by piece against the library that packs.
#include "io/lzf.hpp"

#include <gtest/gtest.h>
#include <lzf.h>

#include <random>
#include <vector>

namespace bitr::io {
namespace {

using Bytes = std::vector<std::byte>;

Bytes pack(const Bytes& bytes) {
  Bytes packed(bytes.size() + bytes.size() / 16 + 64);
  packed.resize(lzf_compress(bytes.data(), static_cast<unsigned>(bytes.size()), packed.data(),
                             static_cast<unsigned>(packed.size())));
  return packed;
}

struct Got {
  Bytes bytes;
  std::size_t pieces = 0;
  LzfUnpacked result;
};

Got unpack(const Bytes& packed, std::uint64_t size) {
  Got got;
  got.result = unpack_lzf(packed, size, [&](std::uint64_t offset, std::span<const std::byte> piece) {
    EXPECT_EQ(offset, got.bytes.size());
    got.bytes.insert(got.bytes.end(), piece.begin(), piece.end());
    ++got.pieces;
  });
  return got;
}

/// Runs, repetitions near and far, and noise.
Bytes mixture(std::size_t size) {
  std::mt19937 random(7);
  Bytes bytes;
  while (bytes.size() < size) {
    const std::size_t length = 1 + random() % 600;
    switch (random() % 3) {
      case 0:
        bytes.insert(bytes.end(), length, static_cast<std::byte>(random()));
        break;
      case 1:
        for (std::size_t i = 0; i < length; ++i) bytes.push_back(static_cast<std::byte>(random()));
        break;
      default:
        if (bytes.empty()) break;
        const std::size_t from = bytes.size() - 1 - random() % std::min<std::size_t>(bytes.size(), 8192);
        for (std::size_t i = 0; i < length; ++i) bytes.push_back(bytes[from + i]);
    }
  }
  bytes.resize(size);
  return bytes;
}

TEST(Lzf, UnpacksWhatWasPacked) {
  for (const std::size_t size : {5u, 300u, 9000u, 1u << 20, 5'000'000u}) {
    const Bytes bytes = mixture(size), packed = pack(bytes);
    ASSERT_FALSE(packed.empty()) << size;
    const Got got = unpack(packed, size);
    EXPECT_TRUE(got.result.whole) << size;
    EXPECT_EQ(got.result.bytes, size);
    EXPECT_TRUE(got.bytes == bytes) << size;
    EXPECT_GE(got.pieces, size >> 20);
  }
}

TEST(Lzf, StopsWhereTheBlockIsDamaged) {
  const Bytes bytes = mixture(20'000), packed = pack(bytes);
  // Cut off anywhere, it gives a beginning of what was packed and says that this is not all.
  for (std::size_t size = 0; size < packed.size(); size += 37) {
    const Got got = unpack(Bytes(packed.begin(), packed.begin() + static_cast<std::ptrdiff_t>(size)), 20'000);
    EXPECT_FALSE(got.result.whole);
    ASSERT_LE(got.bytes.size(), bytes.size());
    EXPECT_TRUE(std::equal(got.bytes.begin(), got.bytes.end(), bytes.begin()));
  }
  EXPECT_FALSE(unpack(packed, 19'999).result.whole) << "more than there is room for";
  EXPECT_LE(unpack(packed, 19'999).bytes.size(), 19'999u);
  EXPECT_FALSE(unpack(packed, 20'001).result.whole) << "less than was promised";
}

TEST(Lzf, RepeatsNothingThatIsNotThere) {
  const std::byte a{'a'};
  // One plain byte; then three bytes from two back, where there is one.
  const Got got = unpack({std::byte{0}, a, std::byte{1 << 5}, std::byte{1}}, 4);
  EXPECT_FALSE(got.result.whole);
  EXPECT_EQ(got.bytes, Bytes{a});
  EXPECT_EQ(unpack({std::byte{0}, a, std::byte{1 << 5}, std::byte{0}}, 4).bytes, Bytes(4, a));
}

}  // namespace
}  // namespace bitr::io
