// The public API's promise that nothing throws across it, and the way back.
#pragma once

#include <bitr/result.hpp>
#include <exception>
#include <new>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "core/failure.hpp"

namespace bitr {

/// body(), which returns a Result; what it throws comes back as an error.
template <class Body>
auto guarded(Body body) -> decltype(body()) {
  try {
    return body();
  } catch (const Failure& failure) {
    return tl::unexpected(failure.error());
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::internal, "out of memory");
  } catch (const std::exception& error) {
    return fail(ErrorCode::internal, error.what());
  }
}

/// What guarded() undoes: a Result's value, or its error as a Failure, `context` in front of the message.
template <class T>
T value_or_throw(Result<T> result, std::string_view context = {}) {
  if (!result) throw Failure(result.error().code, std::string(context) + result.error().message);
  if constexpr (!std::is_void_v<T>) return std::move(*result);
}

}  // namespace bitr
