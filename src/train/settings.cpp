// The configuration file: one walk over all settings reads them, another writes them.
#include <algorithm>
#include <bitr/train.hpp>
#include <cmath>
#include <cstdio>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "core/guarded.hpp"
#include "model/config.hpp"

namespace bitr {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t most = 1'000'000'000;
constexpr std::uint64_t most_channels = 256;

template <class Value>
using Words = std::vector<std::pair<const char*, Value>>;

const Words<Mode> modes = {{"scale-exact", Mode::scale_exact}, {"reference", Mode::reference}};
const Words<TrainLoss> losses = {
    {"direct", TrainLoss::direct}, {"robust", TrainLoss::robust}, {"official", TrainLoss::official}};
const Words<ShapeSplit> splits = {
    {"auto", ShapeSplit::automatic}, {"shapes", ShapeSplit::shapes}, {"none", ShapeSplit::none}};
Words<std::optional<Protocol>> protocol_words() {
  Words<std::optional<Protocol>> words = {{"", std::nullopt}};
  for (const ProtocolName& protocol : protocols())
    words.emplace_back(protocol.name.data(), protocol.protocol);
  return words;
}

DataPart default_part() { return {.share_low = 0.3, .share_high = 0.7}; }

template <class Walker>
void walk(Walker& w, DataPart& part) {
  w.text("kind", part.kind);
  w.count("shapes", part.shapes, 1, 10'000'000);
  w.count("first_seed", part.first_seed, 0, std::numeric_limits<std::uint64_t>::max());
  w.path("folder", part.folder);
  w.count("pool", part.pool, 0, 1'000'000);
  w.count("breaks", part.breaks, 1, 1000);
  w.word("protocol", part.protocol, protocol_words());
  w.range("share", part.share_low, part.share_high, 1e-6, 1);
  w.number("weight", part.weight, 1e-9, 1e9);
}

/// Every setting by its name; `Walker` decides what is done with it.
template <class Walker>
void walk(Walker& w, TrainOptions& o) {
  w.model("model", o.model);
  w.word("mode", o.mode, modes);
  w.count("seed", o.seed, 0, std::numeric_limits<std::uint64_t>::max());
  w.path("init", o.init);
  w.section("widen", [&] {
    w.count("num_channels", o.widen.num_channels, 0, most_channels);
    w.count("feature_num_channels", o.widen.feature_num_channels, 0, most_channels);
    w.count("predict_head", o.widen.predict_head, 0, most_channels);
  });
  w.number("key_logit_scale", o.key_logit_scale, 1e-3, 1e3);
  w.number("feature_scale", o.feature_scale, 1e-3, 1e3);
  w.word("loss", o.loss, losses);
  w.count("steps", o.steps, 1, most);
  w.count("batch", o.batch, 1, 4096);
  w.count("accumulate", o.accumulate, 1, 4096);
  w.section("optimizer", [&] {
    w.number("lr", o.optimizer.lr, 0, 1);
    w.number("beta1", o.optimizer.beta1, 0, 0.999999);
    w.number("beta2", o.optimizer.beta2, 0, 0.999999999);
    w.number("eps", o.optimizer.eps, 1e-30, 1);
    w.number("clip_value", o.optimizer.clip_value, 0, 1e30);
    w.number("clip_norm", o.optimizer.clip_norm, 0, 1e30);
  });
  w.section("schedule", [&] {
    w.count("warmup", o.schedule.warmup, 0, most);
    w.number("floor", o.schedule.floor, 0, 1);
  });
  w.number("ema_decay", o.ema_decay, 0, 0.999999999);
  w.section("data", [&] {
    w.list("parts", o.data.parts);
    w.word("split", o.split, splits);
    w.number("validation_share", o.data.validation_share, 0, 1);
    w.number("test_share", o.data.test_share, 0, 1);
    w.range("points", o.data.points_low, o.data.points_high, 2, max_generated_points);
    w.range("roughness", o.data.roughness_low, o.data.roughness_high, 0, 0.1);
    w.number("noise", o.data.noise, 0, 1);
    w.number("clip", o.data.clip, 0, 1e6);
    w.number("translation", o.data.translation, 0, 1e6);
    w.flag("same_points", o.data.same_points);
    w.count("cache_bytes", o.data.cache_bytes, 0, std::size_t{1} << 46);
    w.count("threads", o.data_threads, 0, 256);
  });
  w.section("validation", [&] {
    w.count("every", o.validation.every, 0, most);
    w.count("samples", o.validation.samples, 1, 1'000'000);
    w.count("seed", o.validation.seed, 0, std::numeric_limits<std::uint64_t>::max());
    w.list("parts", o.validation.parts);
    w.count("patience", o.validation.patience, 0, most);
  });
  w.section("checkpoint", [&] {
    w.number("seconds", o.checkpoint.seconds, 0, 1e9);
    w.count("steps", o.checkpoint.steps, 0, most);
  });
  w.number("minutes", o.minutes, 0, 1e9);
  w.count("log_every", o.log_every, 1, most);
}

class Writer {
 public:
  Json json = Json::object();

  void text(const char* key, const std::string& value) { json[key] = value; }
  void path(const char* key, const std::filesystem::path& value) { json[key] = value.string(); }
  void flag(const char* key, bool value) { json[key] = value; }
  void number(const char* key, double value, double, double) { json[key] = value; }
  template <class Count>
  void count(const char* key, Count value, std::uint64_t, std::uint64_t) {
    json[key] = value;
  }
  template <class Number, class Least, class Most>
  void range(const char* key, Number low, Number high, Least, Most) {
    json[key] = {low, high};
  }
  template <class Value>
  void word(const char* key, const Value& value, const Words<Value>& words) {
    for (const auto& [text, meaning] : words)
      if (meaning == value) json[key] = text;
  }
  void model(const char* key, const ModelConfig& config) { json[key] = Json::parse(model::to_json(config)); }
  template <class Body>
  void section(const char* key, Body body) {
    Json outer = std::exchange(json, Json::object());
    body();
    outer[key] = std::move(json);
    json = std::move(outer);
  }
  void list(const char* key, std::vector<DataPart>& parts) {
    Json all = Json::array();
    for (DataPart& part : parts) {
      Writer inner;
      walk(inner, part);
      all.push_back(std::move(inner.json));
    }
    json[key] = std::move(all);
  }
};

std::string shortest(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.10g", value);
  return text;
}

class Reader {
 public:
  Reader(const Json& json, std::string file, std::span<const TrainOverride> overrides)
      : file_(std::move(file)), overrides_(overrides) {
    enter(json, "");
  }

  void done() { leave(); }

  void text(const char* key, std::string& value) {
    if (const Json* found = find(key)) {
      if (!found->is_string()) wrong(key, *found, "must be a text");
      value = found->get<std::string>();
    }
  }

  void path(const char* key, std::filesystem::path& value) {
    std::string name = value.string();
    text(key, name);
    value = name;
  }

  void flag(const char* key, bool& value) {
    if (const Json* found = find(key)) {
      if (!found->is_boolean()) wrong(key, *found, "must be true or false");
      value = found->get<bool>();
    }
  }

  void number(const char* key, double& value, double low, double high) {
    if (const Json* found = find(key)) value = number_in(key, *found, low, high);
  }

  template <class Count>
  void count(const char* key, Count& value, std::uint64_t low, std::uint64_t high) {
    if (const Json* found = find(key)) value = static_cast<Count>(count_in(key, *found, low, high));
  }

  void range(const char* key, double& low, double& high, double least, double largest) {
    range_of(key, low, high, [&](const Json& j) { return number_in(key, j, least, largest); });
  }
  void range(const char* key, std::size_t& low, std::size_t& high, std::size_t least, std::size_t largest) {
    range_of(key, low, high,
             [&](const Json& j) { return static_cast<std::size_t>(count_in(key, j, least, largest)); });
  }

  template <class Value>
  void word(const char* key, Value& value, const Words<Value>& words) {
    const Json* found = find(key);
    if (!found) return;
    std::string all;
    for (const auto& [text, meaning] : words) {
      if (found->is_string() && found->get_ref<const std::string&>() == text) {
        value = meaning;
        return;
      }
      all += (all.empty() ? "" : ", ") + Json(text).dump();
    }
    wrong(key, *found, "must be one of " + all);
  }

  void model(const char* key, ModelConfig& config) {
    const Json* found = find(key);
    if (!found) return;
    if (!found->is_object()) wrong(key, *found, "must be an object");
    Json whole = Json::parse(model::to_json(config));
    for (const auto& [name, value] : found->items()) {
      if (!whole.contains(name)) unknown(std::string(key) + "." + name, names_of(whole));
      whole[name] = value;
    }
    const auto read = model::config_from_json(whole.dump(), "");
    if (read) {
      config = *read;
      return;
    }
    // ": bitr.config.NAME is …": here the field has another name.
    std::string message = read.error().message;
    constexpr std::string_view prefix = ": bitr.config";
    if (message.starts_with(prefix)) message.erase(0, prefix.size() + 1);
    if (message.starts_with(' ')) message.erase(0, 1);
    const std::string name = message.substr(0, message.find(' '));
    refuse(label(std::string(key) + "." + name) + ": " + key + "." + message);
  }

  template <class Body>
  void section(const char* key, Body body) {
    const Json* found = find(key);
    if (!found) return;
    if (!found->is_object()) wrong(key, *found, "must be an object");
    enter(*found, path_of(key) + ".");
    body();
    leave();
  }

  void list(const char* key, std::vector<DataPart>& parts) {
    const Json* found = find(key);
    if (!found) return;
    if (!found->is_array()) wrong(key, *found, "must be a list of objects");
    parts.clear();
    for (std::size_t i = 0; i < found->size(); ++i) {
      const Json& element = (*found)[i];
      const std::string name = std::string(key) + "." + std::to_string(i);
      if (!element.is_object()) wrong(name.c_str(), element, "must be an object");
      enter(element, path_of(name) + ".");
      parts.push_back(default_part());
      walk(*this, parts.back());
      leave();
    }
  }

 private:
  struct Level {
    const Json* json;
    std::string path;
    std::set<std::string> known;
  };

  void enter(const Json& json, std::string path) { levels_.push_back({&json, std::move(path), {}}); }

  void leave() {
    for (const auto& [key, value] : levels_.back().json->items())
      if (!levels_.back().known.contains(key)) unknown(key, levels_.back().known);
    levels_.pop_back();
  }

  const Json* find(const char* key) {
    levels_.back().known.insert(key);
    const auto found = levels_.back().json->find(key);
    return found == levels_.back().json->end() ? nullptr : &*found;
  }

  std::string path_of(const std::string& key) const { return levels_.back().path + key; }

  /// What gave the value of this setting: the last override of it, of what it is in or of a part of it.
  std::string label(const std::string& key) const {
    const std::string path = path_of(key);
    for (auto it = overrides_.rbegin(); it != overrides_.rend(); ++it)
      if ((path + ".").starts_with(it->key + ".") || (it->key + ".").starts_with(path + "."))
        return it->label;
    return file_;
  }

  [[noreturn]] static void refuse(const std::string& message) {
    throw Failure(ErrorCode::invalid_argument, message);
  }

  [[noreturn]] void wrong(const char* key, const Json& value, const std::string& rule) const {
    std::string text = value.is_structured() ? value.type_name()
                                             : value.dump(-1, ' ', false, Json::error_handler_t::replace);
    if (text.size() > 80) text = text.substr(0, 80) + "…";
    refuse(label(key) + ": " + path_of(key) + " is " + text + ", " + rule);
  }

  [[noreturn]] void unknown(const std::string& key, const std::set<std::string>& names) const {
    std::string all;
    for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
    refuse(label(key) + ": " + path_of(key) + " is no setting; there are " + all);
  }

  static std::set<std::string> names_of(const Json& object) {
    std::set<std::string> names;
    for (const auto& [name, value] : object.items()) names.insert(name);
    return names;
  }

  double number_in(const char* key, const Json& value, double low, double high) const {
    if (value.is_number())
      if (const double x = value.get<double>(); x >= low && x <= high) return x;
    wrong(key, value, "must be a number in " + shortest(low) + " … " + shortest(high));
  }

  std::uint64_t count_in(const char* key, const Json& value, std::uint64_t low, std::uint64_t high) const {
    if (value.is_number_unsigned())
      if (const auto n = value.get<std::uint64_t>(); n >= low && n <= high) return n;
    wrong(key, value, "must be a whole number in " + std::to_string(low) + " … " + std::to_string(high));
  }

  template <class Number, class Parse>
  void range_of(const char* key, Number& low, Number& high, Parse parse) {
    const Json* found = find(key);
    if (!found) return;
    if (!found->is_array()) {
      low = high = parse(*found);
      return;
    }
    if (found->size() != 2) wrong(key, *found, "must be one number or two");
    low = parse((*found)[0]);
    high = parse((*found)[1]);
    if (low > high)
      refuse(label(key) + ": " + path_of(key) + " is " + found->dump() + ", must not run backwards");
  }

  std::string file_;
  std::span<const TrainOverride> overrides_;
  std::vector<Level> levels_;
};

/// Puts a value at "a.b.0.c"; objects and the next element of a list are made as they are needed.
void put(Json& json, const TrainOverride& setting) {
  Json value = Json::parse(setting.value, nullptr, false, true);
  if (value.is_discarded()) value = setting.value;
  Json* at = &json;
  std::size_t begin = 0;
  for (;;) {
    const std::size_t dot = setting.key.find('.', begin);
    const std::string name = setting.key.substr(begin, dot - begin);
    if (name.empty())
      throw Failure(ErrorCode::invalid_argument, setting.label + ": a part of the key is empty");
    if (at->is_array()) {
      const bool digits = name.size() <= 6 && name.find_first_not_of("0123456789") == std::string::npos;
      const std::size_t index = digits ? std::stoul(name) : most;
      if (index > at->size())
        throw Failure(ErrorCode::invalid_argument, setting.label + ": \"" + name + "\" is not in 0 … " +
                                                       std::to_string(at->size()) +
                                                       ", the list's elements and the next");
      if (index == at->size()) at->push_back(Json::object());
      at = &(*at)[index];
    } else {
      if (!at->is_object()) *at = Json::object();
      at = &(*at)[name];
    }
    if (dot == std::string::npos) break;
    begin = dot + 1;
  }
  *at = std::move(value);
}

/// What a message of the JSON library has in single quotes.
std::string number_in(std::string_view message) {
  const std::size_t first = message.find('\''), last = message.rfind('\'');
  return first < last && last != message.npos ? std::string(message.substr(first + 1, last - first - 1))
                                              : "a number";
}

}  // namespace

ModelConfig TrainOptions::trainable_config() {
  ModelConfig config;
  config.return_normals = true;
  config.neighbor_dilation = 4;
  config.relu_square = true;
  return config;
}

DataOptions TrainOptions::train_data() {
  DataOptions data;
  data.points_low = 512;
  data.points_high = 2048;
  data.noise = 0.01;
  return data;
}

Result<TrainOptions> parse_train_options(std::string_view json, const std::string& file,
                                         std::span<const TrainOverride> overrides) {
  return guarded([&]() -> Result<TrainOptions> {
    Json document;
    try {
      document = Json::parse(json, nullptr, true, true);
    } catch (const Json::parse_error& error) {
      return fail(ErrorCode::bad_file,
                  file + ": byte " + std::to_string(error.byte) + ": not valid JSON (comments are allowed)");
    } catch (const Json::out_of_range& error) {
      return fail(ErrorCode::bad_file,
                  file + ": " + number_in(error.what()) + " is beyond the largest number, about 1.8e308");
    }
    if (!document.is_object())
      return fail(ErrorCode::bad_file, file + ": holds " + document.type_name() + ", not an object");
    for (const TrainOverride& setting : overrides) put(document, setting);
    TrainOptions options;
    Reader reader(document, file, overrides);
    walk(reader, options);
    reader.done();
    options.data.normals = options.model.return_normals;
    return options;
  });
}

std::string to_json(const TrainOptions& options) {
  TrainOptions copy = options;
  Writer writer;
  walk(writer, copy);
  return writer.json.dump(2, ' ', false, Json::error_handler_t::replace);
}

}  // namespace bitr
