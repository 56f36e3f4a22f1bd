// An Error on its way to the public API, which turns it into a Result (core/guarded.hpp).
#pragma once

#include <bitr/result.hpp>
#include <stdexcept>
#include <utility>

namespace bitr {

class Failure : public std::runtime_error {
 public:
  Failure(ErrorCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  Error error() const { return {code_, what()}; }

 private:
  ErrorCode code_;
};

/// Of an argument that a caller must not give.
[[noreturn]] inline void refuse(const std::string& why) { throw Failure(ErrorCode::invalid_argument, why); }

}  // namespace bitr
