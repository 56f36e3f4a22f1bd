// Names that come from a file, made safe to print: an error message stays one line whatever the file holds.
#pragma once

#include <string>
#include <string_view>

namespace bitr::io {

/// `text` in double quotes; bytes outside printable ASCII become \xNN, and past 100 characters it ends in
/// "…".
std::string in_quotes(std::string_view text);

/// True when `text` is well-formed UTF-8: no overlong form, no surrogate, nothing past U+10FFFF.
bool is_utf8(std::string_view text);

}  // namespace bitr::io
