#include "precompute/solvers/dissection.h"

#include <cstdio>  // what Scotch's header needs
#include <memory>
#include <scotch.h>

#include "common/core/error.h"

namespace exmat::precompute {
namespace {

static_assert(sizeof(SCOTCH_Num) == sizeof(std::int32_t));

void check(int code, const char* what) {
  if (code != 0) throw WorkError(std::string("Scotch: ") + what + " failed");
}

// Objects of Scotch end with one function each.
template <typename Object, void (*end)(Object*)>
using Ended = std::unique_ptr<Object, decltype([](Object* object) { end(object); })>;

}  // namespace

std::vector<std::int32_t> nested_dissection(const Graph& graph) {
  std::vector<std::int32_t> place(static_cast<std::size_t>(graph.size()));
  if (place.empty()) return place;
  SCOTCH_Context context;
  check(SCOTCH_contextInit(&context), "its context");
  const Ended<SCOTCH_Context, SCOTCH_contextExit> end_context(&context);
  check(SCOTCH_contextOptionSetNum(&context, SCOTCH_OPTIONNUMDETERMINISTIC, 1), "an option");
  check(SCOTCH_contextOptionSetNum(&context, SCOTCH_OPTIONNUMRANDOMFIXEDSEED, 1), "an option");
  SCOTCH_randomReset();
  SCOTCH_Graph whole, bound;
  check(SCOTCH_graphInit(&whole), "a graph");
  const Ended<SCOTCH_Graph, SCOTCH_graphExit> end_whole(&whole);
  const SCOTCH_Num* starts = graph.starts.data();
  check(SCOTCH_graphBuild(&whole, 0, graph.size(), starts, nullptr, nullptr, nullptr,
                          static_cast<SCOTCH_Num>(graph.neighbours.size()), graph.neighbours.data(), nullptr),
        "building a graph");
  check(SCOTCH_graphInit(&bound), "a graph");
  const Ended<SCOTCH_Graph, SCOTCH_graphExit> end_bound(&bound);
  check(SCOTCH_contextBindGraph(&context, &whole, &bound), "its context");
  SCOTCH_Strat strategy;
  check(SCOTCH_stratInit(&strategy), "a strategy");
  const Ended<SCOTCH_Strat, SCOTCH_stratExit> end_strategy(&strategy);
  check(SCOTCH_graphOrder(&bound, &strategy, place.data(), nullptr, nullptr, nullptr, nullptr), "nested dissection");
  return place;
}

}  // namespace exmat::precompute
