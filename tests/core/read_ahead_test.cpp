// Values made ahead, and what is thrown instead of one.
#include "core/read_ahead.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

namespace bitr {
namespace {

TEST(ReadAhead, ThrowsInPlaceOfTheValue) {
  for (const unsigned threads : {0u, 1u, 3u}) {
    ReadAhead<std::uint64_t> values(threads, 4, [](std::uint64_t number) {
      if (number % 3 == 1) throw std::runtime_error(std::to_string(number));
      return 10 * number;
    });
    for (std::uint64_t number = 0; number < 30; ++number) {
      if (number % 3 != 1) {
        EXPECT_EQ(values.next(), 10 * number) << threads;
        continue;
      }
      try {
        ADD_FAILURE() << values.next() << " in place of " << number << ", " << threads << " threads";
      } catch (const std::runtime_error& error) {
        EXPECT_EQ(error.what(), std::to_string(number));
      }
    }
    EXPECT_EQ(values.given(), 30u);
  }
}

}  // namespace
}  // namespace bitr
