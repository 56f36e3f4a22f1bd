// A plan's last assemble() as a trace that browsers draw.
#include <nlohmann/json.hpp>

#include "api/internal.hpp"
#include "api/plan.hpp"

namespace bitr {
namespace {

using Json = nlohmann::ordered_json;

// Two rows: whole passes by the host's clock, and their operations by the device's.
constexpr int process = 1, pass_row = 1, operation_row = 2;

Json span(const StageTime& time, int row) {
  // Microseconds.
  return {
      {"name", time.stage}, {"ph", "X"},  {"ts", 1000 * time.start_ms},   {"dur", 1000 * time.milliseconds},
      {"pid", process},     {"tid", row}, {"args", {{"pass", time.pass}}}};
}

Json label(const char* what, const std::string& name, int row) {
  return {{"name", what}, {"ph", "M"}, {"pid", process}, {"tid", row}, {"args", {{"name", name}}}};
}

}  // namespace

std::string chrome_trace(const Plan& plan) {
  const Plan::Impl& impl = Internal::impl(plan);
  Json events = Json::array();
  events.push_back(label("process_name", plan.device().name(), pass_row));
  events.push_back(label("thread_name", "forward passes", pass_row));
  events.push_back(label("thread_name", "operations", operation_row));
  for (const StageTime& pass : impl.passes) events.push_back(span(pass, pass_row));
  for (const StageTime& operation : impl.profile) events.push_back(span(operation, operation_row));
  const Json trace = {{"traceEvents", std::move(events)},
                      {"displayTimeUnit", "ms"},
                      {"otherData",
                       {{"backend", name(plan.device().backend())},
                        {"device", plan.device().name()},
                        {"model", plan.model().name()}}}};
  return trace.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace bitr
