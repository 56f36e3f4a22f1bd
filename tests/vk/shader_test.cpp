// What is known of a shader is held against what it is given.
#include "core/failure.hpp"
#include "vk/network.hpp"
#include "vk/parameters.hpp"
#include "vk/schedule.hpp"

namespace bitr::vk {
namespace {

constexpr Access every_access[] = {Access::read, Access::write, Access::modify, Access::constant,
                                   Access::texels};
constexpr ShaderOf<RowParameters, 2> shader{"some shader", {}, every_access};

template <class Constants>
concept MakesAPipeline = requires(const Context& context, const Constants& constants) {
  context.pipeline(shader, constants);
};
static_assert(MakesAPipeline<std::array<std::uint32_t, 2>>);
static_assert(!MakesAPipeline<std::array<std::uint32_t, 1>>);
static_assert(!MakesAPipeline<std::array<std::uint32_t, 3>>);
static_assert(!MakesAPipeline<std::array<float, 2>>);

template <class Parameters>
concept Dispatches = requires(Schedule& schedule, PipelineOf<RowParameters> pipeline,
                              const Parameters& parameters) {
  schedule.dispatch(pipeline, {}, parameters, {1, 1, 1}, 0);
};
static_assert(Dispatches<RowParameters>);
// As large as that.
static_assert(sizeof(ItemParameters) == sizeof(RowParameters) && !Dispatches<ItemParameters>);
static_assert(!Dispatches<NoParameters>);

template <class Call>
std::string failure_of(const Call& call) {
  try {
    call();
  } catch (const Failure& failure) {
    EXPECT_EQ(failure.error().code, ErrorCode::internal);
    return failure.what();
  }
  return "none";
}

TEST(Shader, IsGivenAsManyConstantsAsItHas) {
  BITR_NEEDS_VULKAN();
  EXPECT_EQ(failure_of([] { test::vulkan()->pipeline(shader, std::vector<std::uint32_t>(3, 1)); }),
            "some shader: 3 specialization constants for 2");
}

TEST(Schedule, BindsAsManyRangesAsTheShaderHas) {
  const Pipeline pipeline{.shader = &shader};
  const PipelineOf<RowParameters> typed(pipeline);
  Schedule schedule;
  EXPECT_EQ(failure_of([&] {
              schedule.dispatch(typed, std::vector<Range>(4), {7}, {1, 1, 1}, 0);
            }),
            "some shader: 4 ranges for 5 bindings");
  EXPECT_TRUE(schedule.dispatches().empty());
  schedule.dispatch(typed, std::vector<Range>(5), {7}, {1, 1, 1}, 0);
  ASSERT_EQ(schedule.dispatches().size(), 1u);
  const Dispatch& work = schedule.dispatches()[0];
  std::uint32_t rows;
  std::memcpy(&rows, work.push.data(), sizeof rows);
  EXPECT_EQ(rows, 7u);
  std::vector<bool> written;
  for (std::size_t i = 0; i < 5; ++i) written.push_back(work.writes(i));
  EXPECT_EQ(written, (std::vector<bool>{false, true, true, false, false}));
}

}  // namespace
}  // namespace bitr::vk
