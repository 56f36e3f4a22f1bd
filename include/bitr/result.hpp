// Errors as values: every fallible call of the public API returns Result<T>; none throws, prints or aborts.
#pragma once

#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <utility>

namespace bitr {

enum class ErrorCode {
  invalid_argument,  ///< a value passed by the caller is outside its documented range
  bad_file,          ///< a file's content is malformed; the message names the file, the offset and the limit
  io,                ///< the operating system refused to open, read or write
  unsupported,       ///< valid, but not something this build or backend can do
  no_device,         ///< no Vulkan loader, no suitable device, or none of the asked name or index
  device_lost,       ///< the device stopped answering: its plans are of no use any more, a new device is
  internal,          ///< memory ran out, or an invariant of the library itself is broken
};

/// What went wrong: the message is one line that names the value and the limit it broke.
struct Error {
  ErrorCode code = ErrorCode::internal;
  std::string message;
};

template <class T>
using Result = tl::expected<T, Error>;

/// `return fail(ErrorCode::io, "…");` from any function that returns a Result.
inline tl::unexpected<Error> fail(ErrorCode code, std::string message) {
  return tl::unexpected<Error>(Error{code, std::move(message)});
}

/// Short stable name of a code, for logs and JSON ("invalid_argument", "bad_file", …).
std::string_view name(ErrorCode code);

}  // namespace bitr
