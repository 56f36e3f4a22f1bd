// The public API's promise that nothing throws across it.
#pragma once

#include <bitr/result.hpp>
#include <exception>
#include <new>

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

}  // namespace bitr
