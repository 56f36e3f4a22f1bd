#include "io/pickle.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <optional>
#include <string>

#include "io/pickle_opcodes.hpp"
#include "io/quote.hpp"

namespace bitr::io::pickle {
namespace {

constexpr std::size_t byte_limit = std::size_t{64} << 20;
constexpr std::size_t value_limit = std::size_t{1} << 22;
constexpr std::size_t stack_limit = std::size_t{1} << 20;
constexpr std::size_t mark_limit = 1000;
constexpr std::size_t rank_limit = 64;
constexpr Id unset = ~Id{0};

std::optional<Global> allowed(std::string_view module, std::string_view member) {
  using Kind = Global::Kind;
  struct Row {
    std::string_view module, member;
    Global global;
  };
  static constexpr Row rows[] = {
      {"collections", "OrderedDict", {Kind::ordered_dict}},
      {"torch._utils", "_rebuild_tensor_v2", {Kind::rebuild_tensor}},
      {"torch._utils", "_rebuild_parameter", {Kind::rebuild_parameter}},
      {"torch", "FloatStorage", {Kind::storage, DType::f32}},
      {"torch", "DoubleStorage", {Kind::storage, DType::f64}},
      {"torch", "HalfStorage", {Kind::storage, DType::f16}},
      {"torch", "BFloat16Storage", {Kind::storage, DType::bf16}},
      {"torch", "LongStorage", {Kind::storage, DType::i64}},
      {"torch", "IntStorage", {Kind::storage, DType::i32}},
      {"torch", "ShortStorage", {Kind::storage, DType::i16}},
      {"torch", "CharStorage", {Kind::storage, DType::i8}},
      {"torch", "ByteStorage", {Kind::storage, DType::u8}},
      {"torch", "BoolStorage", {Kind::storage, DType::boolean}},
  };
  for (const Row& row : rows) {
    if (row.module == module && row.member == member) return row.global;
  }
  return std::nullopt;
}

class Machine {
 public:
  explicit Machine(std::span<const std::byte> bytes)
      : text_(reinterpret_cast<const char*>(bytes.data()), bytes.size()) {}

  /// True when the pickle ran to its STOP; otherwise `problem` says where and why not.
  bool run() {
    if (text_.size() > byte_limit)
      return refuse(std::to_string(text_.size()) + " bytes, limit " + std::to_string(byte_limit));
    while (next_ < text_.size()) {
      at_ = next_;
      opcode_ = static_cast<std::uint8_t>(text_[next_++]);
      if ((at_ == 0) != (Op{opcode_} == Op::proto)) {
        return refuse(at_ == 0 ? "a pickle of protocol 2 or later starts with PROTO"
                               : "PROTO comes a second time");
      }
      if (Op{opcode_} == Op::stop) return stop();
      if (!step()) return false;
    }
    at_ = next_;
    return refuse("the pickle ends without STOP");
  }

  Document document;
  std::string problem;

 private:
  bool refuse(std::string_view why) {
    problem = "byte " + std::to_string(at_) + ": " + std::string(why);
    return false;
  }

  bool step() {
    std::uint64_t number = 0;
    switch (Op{opcode_}) {
      case Op::proto:
        return argument(1, number) && ((number >= 2 && number <= 5) ||
                                       refuse("protocol " + std::to_string(number) + ", not 2 to 5"));
      case Op::frame:
        return argument(8, number) && (number <= text_.size() - next_ || truncated(number));
      case Op::mark:
        if (marks_.size() == mark_limit) return refuse("more than " + std::to_string(mark_limit) + " marks");
        marks_.push_back(stack_.size());
        return true;
      case Op::none:
        return push(None{});
      case Op::newtrue:
        return push(true);
      case Op::newfalse:
        return push(false);
      case Op::binint:
        return argument(4, number) && push(std::int64_t{static_cast<std::int32_t>(number)});
      case Op::binint1:
        return argument(1, number) && push(static_cast<std::int64_t>(number));
      case Op::binint2:
        return argument(2, number) && push(static_cast<std::int64_t>(number));
      case Op::long1:
        return long_integer();
      case Op::binfloat:
        return real();
      case Op::short_binunicode:
        return unicode(1);
      case Op::binunicode:
        return unicode(4);
      case Op::binunicode8:
        return unicode(8);
      case Op::empty_list:
        document.lists.emplace_back();
        return push(List{static_cast<Id>(document.lists.size() - 1)});
      case Op::empty_dict:
        return new_dict(false);
      case Op::empty_tuple:
        return new_tuple(stack_.size());
      case Op::tuple1:
        return has(1) && new_tuple(stack_.size() - 1);
      case Op::tuple2:
        return has(2) && new_tuple(stack_.size() - 2);
      case Op::tuple3:
        return has(3) && new_tuple(stack_.size() - 3);
      case Op::tuple:
        return pop_mark() && new_tuple(mark_);
      case Op::append:
        return has(2) && append(stack_.size() - 1);
      case Op::appends:
        return pop_mark() && append(mark_);
      case Op::setitem:
        return has(3) && set_items(stack_.size() - 2);
      case Op::setitems:
        return pop_mark() && set_items(mark_);
      case Op::memoize:
        return put(memoized_);
      case Op::binput:
        return argument(1, number) && put(number);
      case Op::long_binput:
        return argument(4, number) && put(number);
      case Op::binget:
        return argument(1, number) && fetch(number);
      case Op::long_binget:
        return argument(4, number) && fetch(number);
      case Op::global:
        return global();
      case Op::stack_global:
        return stack_global();
      case Op::binpersid:
        return persistent();
      case Op::reduce:
        return reduce();
      case Op::build:
        return build();
      case Op::stop:
        break;
    }
    return refuse("refuses opcode " + opcode_name(opcode_));
  }

  bool stop() {
    if (!marks_.empty() || stack_.size() != 1) {
      return refuse("STOP with " + std::to_string(stack_.size()) + " values and " +
                    std::to_string(marks_.size()) + " marks on the stack, not one value");
    }
    if (next_ != text_.size()) return refuse(std::to_string(text_.size() - next_) + " bytes follow STOP");
    document.root = stack_[0];
    return true;
  }

  bool truncated(std::uint64_t needed) {
    return refuse("opcode " + opcode_name(opcode_) + " needs " + std::to_string(needed) + " bytes, " +
                  std::to_string(text_.size() - next_) + " are left");
  }

  /// The opcode's next `width` bytes as a little-endian number.
  bool argument(std::size_t width, std::uint64_t& number) {
    std::string_view bytes;
    if (!take(width, bytes)) return false;
    number = 0;
    for (std::size_t i = 0; i < width; ++i)
      number |= std::uint64_t{static_cast<std::uint8_t>(bytes[i])} << 8 * i;
    return true;
  }

  bool take(std::uint64_t count, std::string_view& bytes) {
    if (count > text_.size() - next_) return truncated(count);
    bytes = text_.substr(next_, count);
    next_ += count;
    return true;
  }

  bool long_integer() {
    std::uint64_t width = 0;
    std::uint64_t bits = 0;
    if (!argument(1, width)) return false;
    if (width > 8) return refuse("integer of " + std::to_string(width) + " bytes, limit 8");
    if (!argument(width, bits)) return false;
    const std::uint64_t unused = 64 - 8 * width;
    return push(width == 0 ? 0 : static_cast<std::int64_t>(bits << unused) >> unused);
  }

  bool real() {
    std::uint64_t bits = 0;
    if (!argument(8, bits)) return false;
    return push(std::bit_cast<double>(__builtin_bswap64(bits)));
  }

  bool unicode(std::size_t width) {
    std::uint64_t size = 0;
    std::string_view text;
    if (!argument(width, size) || !take(size, text)) return false;
    return is_utf8(text) ? push(text) : refuse("text is not valid UTF-8");
  }

  /// The stack below the innermost open mark is out of reach.
  std::size_t floor() const { return marks_.empty() ? 0 : marks_.back(); }

  bool has(std::size_t count) {
    const std::size_t present = stack_.size() - floor();
    return present >= count || refuse("opcode " + opcode_name(opcode_) + " needs " + std::to_string(count) +
                                      " values, the stack has " + std::to_string(present));
  }

  bool pop_mark() {
    if (marks_.empty()) return refuse("opcode " + opcode_name(opcode_) + " without a mark");
    mark_ = marks_.back();
    marks_.pop_back();
    return true;
  }

  bool push(const Value& value) {
    if (document.values.size() == value_limit)
      return refuse("more than " + std::to_string(value_limit) + " values");
    document.values.push_back(value);
    return push_id(static_cast<Id>(document.values.size() - 1));
  }

  bool push_id(Id id) {
    if (stack_.size() == stack_limit)
      return refuse("more than " + std::to_string(stack_limit) + " values on the stack");
    stack_.push_back(id);
    return true;
  }

  Id pop() {
    const Id id = stack_.back();
    stack_.pop_back();
    return id;
  }

  bool new_dict(bool ordered) {
    document.dicts.emplace_back();
    return push(Dict{static_cast<Id>(document.dicts.size() - 1), ordered});
  }

  bool new_tuple(std::size_t from) {
    auto& items = document.tuple_items;
    const Tuple tuple{static_cast<Id>(items.size()), static_cast<Id>(stack_.size() - from)};
    items.insert(items.end(), stack_.begin() + static_cast<std::ptrdiff_t>(from), stack_.end());
    stack_.resize(from);
    return push(tuple);
  }

  /// The container of kind T just below `from`, which an opcode is about to fill.
  template <class T>
  const T* container(std::size_t from, std::string_view what) {
    if (from == floor()) {
      refuse("opcode " + opcode_name(opcode_) + " without " + std::string(what));
      return nullptr;
    }
    const Value& value = document.values[stack_[from - 1]];
    const T* found = std::get_if<T>(&value);
    if (!found)
      refuse("opcode " + opcode_name(opcode_) + " needs " + std::string(what) + ", not " +
             std::string(kind_name(value)));
    return found;
  }

  bool append(std::size_t from) {
    const List* list = container<List>(from, "a list");
    if (!list) return false;
    auto& items = document.lists[list->index];
    items.insert(items.end(), stack_.begin() + static_cast<std::ptrdiff_t>(from), stack_.end());
    stack_.resize(from);
    return true;
  }

  bool set_items(std::size_t from) {
    const Dict* dict = container<Dict>(from, "a dict");
    if (!dict) return false;
    if ((stack_.size() - from) % 2) return refuse("a key without a value");
    auto& items = document.dicts[dict->index];
    for (std::size_t i = from; i < stack_.size(); i += 2) items.emplace_back(stack_[i], stack_[i + 1]);
    stack_.resize(from);
    return true;
  }

  bool put(std::uint64_t index) {
    if (!has(1)) return false;
    // A writer numbers its entries one by one, each with an opcode of its own.
    const std::size_t limit = std::min(text_.size(), value_limit);
    if (index >= limit)
      return refuse("memo entry " + std::to_string(index) + ", limit " + std::to_string(limit));
    if (index >= memo_.size()) memo_.resize(index + 1, unset);
    if (memo_[index] == unset) ++memoized_;
    memo_[index] = stack_.back();
    return true;
  }

  bool fetch(std::uint64_t index) {
    if (index >= memo_.size() || memo_[index] == unset)
      return refuse("memo entry " + std::to_string(index) + " was never set");
    return push_id(memo_[index]);
  }

  bool push_global(std::string_view module, std::string_view member) {
    const auto global = allowed(module, member);
    if (!global)
      return refuse("refuses global " + in_quotes(std::string(module) + "." + std::string(member)));
    return push(*global);
  }

  bool line(std::string_view& text) {
    const std::size_t end = text_.find('\n', next_);
    if (end == std::string_view::npos) return refuse("a global's name without its end of line");
    text = text_.substr(next_, end - next_);
    next_ = end + 1;
    return true;
  }

  bool global() {
    std::string_view module;
    std::string_view member;
    return line(module) && line(member) && push_global(module, member);
  }

  bool stack_global() {
    if (!has(2)) return false;
    const auto* member = document.get<std::string_view>(pop());
    const auto* module = document.get<std::string_view>(pop());
    if (!member || !module) return refuse("a global's name is not text");
    return push_global(*module, *member);
  }

  /// ("storage", class, key, device, number of elements) → a storage; the device it once lay on is of no
  /// interest.
  bool persistent() {
    if (!has(1)) return false;
    const auto* tuple = document.get<Tuple>(pop());
    if (!tuple || tuple->count != 5) return refuse("a persistent id is not a tuple of 5 values");
    const auto items = document.items(*tuple);
    const auto* label = document.get<std::string_view>(items[0]);
    const auto* type = document.get<Global>(items[1]);
    const auto* key = document.get<std::string_view>(items[2]);
    const auto* device = document.get<std::string_view>(items[3]);
    const auto* size = document.get<std::int64_t>(items[4]);
    if (!label || *label != "storage" || !type || type->kind != Global::Kind::storage || !key || !device ||
        !size) {
      return refuse("a persistent id is not (\"storage\", class, key, device, size)");
    }
    if (*size < 0) return refuse("a storage of " + std::to_string(*size) + " elements");
    document.storages.push_back({type->type, *key, static_cast<std::uint64_t>(*size)});
    return push(StorageRef{static_cast<Id>(document.storages.size() - 1)});
  }

  bool reduce() {
    if (!has(2)) return false;
    const auto* arguments = document.get<Tuple>(pop());
    const Value& callee = document.values[pop()];
    const auto* function = std::get_if<Global>(&callee);
    if (!function) return refuse("refuses to call " + std::string(kind_name(callee)));
    if (!arguments) return refuse("the arguments of a call are not a tuple");
    switch (function->kind) {
      case Global::Kind::ordered_dict:
        if (arguments->count)
          return refuse("OrderedDict has " + std::to_string(arguments->count) + " arguments, not 0");
        return new_dict(true);
      case Global::Kind::rebuild_tensor:
        return rebuild_tensor(document.items(*arguments));
      case Global::Kind::rebuild_parameter:
        return rebuild_parameter(document.items(*arguments));
      case Global::Kind::storage:
        break;
    }
    return refuse("refuses to call the class of a storage");
  }

  /// (storage, offset, shape, strides, requires_grad, hooks[, metadata])
  bool rebuild_tensor(std::span<const Id> arguments) {
    if (arguments.size() != 6 && arguments.size() != 7) {
      return refuse("_rebuild_tensor_v2 has " + std::to_string(arguments.size()) + " arguments, not 6 or 7");
    }
    const auto* storage = document.get<StorageRef>(arguments[0]);
    const auto* offset = document.get<std::int64_t>(arguments[1]);
    const auto* shape = document.get<Tuple>(arguments[2]);
    const auto* strides = document.get<Tuple>(arguments[3]);
    if (!storage || !offset || !shape || !strides || !document.get<bool>(arguments[4]) ||
        !document.get<Dict>(arguments[5])) {
      return refuse("_rebuild_tensor_v2 needs (storage, offset, shape, strides, flag, hooks)");
    }
    if (*offset < 0) return refuse("a tensor's offset is " + std::to_string(*offset));
    View view{storage->index, static_cast<std::uint64_t>(*offset), *shape, *strides, 1};
    if (!measure(view)) return false;
    document.tensors.push_back(view);
    return push(TensorRef{static_cast<Id>(document.tensors.size() - 1)});
  }

  /// Sets `view.size`, once every element is known to lie in the storage.
  bool measure(View& view) {
    if (view.shape.count != view.strides.count || view.shape.count > rank_limit) {
      return refuse("a tensor has " + std::to_string(view.shape.count) + " extents and " +
                    std::to_string(view.strides.count) + " strides, limit " + std::to_string(rank_limit));
    }
    const auto shape = document.items(view.shape);
    const auto strides = document.items(view.strides);
    const std::uint64_t size = document.storages[view.storage].size;
    std::uint64_t last = view.offset;
    bool overflow = false;
    bool empty = false;
    for (std::size_t i = 0; i < shape.size(); ++i) {
      const auto* extent = document.get<std::int64_t>(shape[i]);
      const auto* stride = document.get<std::int64_t>(strides[i]);
      if (!extent || !stride || *extent < 0 || *stride < 0)
        return refuse("extents and strides are integers from 0 up");
      overflow |= __builtin_mul_overflow(view.size, static_cast<std::uint64_t>(*extent), &view.size);
      if (*extent == 0) empty = true;
      if (empty) continue;
      std::uint64_t reach = 0;
      overflow |=
          __builtin_mul_overflow(*extent - 1, *stride, &reach) || __builtin_add_overflow(last, reach, &last);
    }
    if (overflow) return refuse("the product of a tensor's shape or strides overflows 64 bits");
    if (empty) return true;
    if (last >= size) {
      return refuse("a tensor reaches element " + std::to_string(last) + ", its storage has " +
                    std::to_string(size));
    }
    return view.size <= size || refuse("a tensor of " + std::to_string(view.size) +
                                       " elements, its storage has " + std::to_string(size));
  }

  /// (tensor, requires_grad, hooks) → the tensor
  bool rebuild_parameter(std::span<const Id> arguments) {
    if (arguments.size() != 3 || !document.get<TensorRef>(arguments[0])) {
      return refuse("_rebuild_parameter needs (tensor, flag, hooks)");
    }
    return push_id(arguments[0]);
  }

  /// A state dict carries its modules' versions as an attribute; nothing else has attributes, and these are
  /// dropped.
  bool build() {
    if (!has(2)) return false;
    const Value& state = document.values[pop()];
    const Value& target = document.values[stack_.back()];
    const auto* dict = std::get_if<Dict>(&target);
    if (!dict || !dict->ordered || !std::holds_alternative<Dict>(state)) {
      return refuse("refuses opcode " + opcode_name(opcode_) + " of " + std::string(kind_name(target)) +
                    " from " + std::string(kind_name(state)));
    }
    return true;
  }

  std::string_view text_;
  std::size_t next_ = 0;  // the first byte not yet read
  std::size_t at_ = 0;    // the byte of the opcode at work
  std::uint8_t opcode_ = 0;
  std::vector<Id> stack_;
  std::vector<std::size_t> marks_;  // heights of the stack
  std::size_t mark_ = 0;            // the mark just popped
  std::vector<Id> memo_;
  std::size_t memoized_ = 0;
};

}  // namespace

std::string_view kind_name(const Value& value) {
  static constexpr std::array<std::string_view, std::variant_size_v<Value>> kinds = {
      "None",   "a boolean", "an integer", "a number",  "text",    "a list",
      "a dict", "a tuple",   "a class",    "a storage", "a tensor"};
  return kinds[value.index()];
}

Result<Document> parse(std::span<const std::byte> bytes, std::string_view name) {
  Machine machine(bytes);
  if (!machine.run()) return fail(ErrorCode::bad_file, std::string(name) + ": " + machine.problem);
  return std::move(machine.document);
}

}  // namespace bitr::io::pickle
