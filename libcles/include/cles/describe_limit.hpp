// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>
#include <boost/describe/enum.hpp>

/// Boost.Describe's macros take at most 52 names. With more, they expand to text of which no compiler says what is
/// wrong, so this makes them expand to an error that does. Not for applications.

namespace cles::detail {

template <class T>
struct too_many_names {
    static_assert(!sizeof(T*), "BOOST_DESCRIBE_STRUCT and BOOST_DESCRIBE_ENUM take at most 52 names: move members to a "
                               "base or a member that is described too");
    static constexpr int* pointer() noexcept { return nullptr; }
    static constexpr T value() noexcept { return {}; }
    static constexpr const char* name() noexcept { return ""; }
};

} // namespace cles::detail

#if defined(BOOST_DESCRIBE_PP_FOR_EACH) && defined(BOOST_DESCRIBE_PP_FOR_EACH_52) &&                                   \
    !defined(BOOST_DESCRIBE_PP_FOR_EACH_53)

#define CLES_DETAIL_NONE(macro, type, ...) , ::cles::detail::too_many_names<type>()
#define CLES_DETAIL_12_NONE                                                                                            \
    CLES_DETAIL_NONE, CLES_DETAIL_NONE, CLES_DETAIL_NONE, CLES_DETAIL_NONE, CLES_DETAIL_NONE, CLES_DETAIL_NONE,        \
        CLES_DETAIL_NONE, CLES_DETAIL_NONE, CLES_DETAIL_NONE, CLES_DETAIL_NONE, CLES_DETAIL_NONE, CLES_DETAIL_NONE
#define CLES_DETAIL_TEN(t)                                                                                             \
    BOOST_DESCRIBE_PP_FOR_EACH_##t##9, BOOST_DESCRIBE_PP_FOR_EACH_##t##8, BOOST_DESCRIBE_PP_FOR_EACH_##t##7,           \
        BOOST_DESCRIBE_PP_FOR_EACH_##t##6, BOOST_DESCRIBE_PP_FOR_EACH_##t##5, BOOST_DESCRIBE_PP_FOR_EACH_##t##4,       \
        BOOST_DESCRIBE_PP_FOR_EACH_##t##3, BOOST_DESCRIBE_PP_FOR_EACH_##t##2, BOOST_DESCRIBE_PP_FOR_EACH_##t##1,       \
        BOOST_DESCRIBE_PP_FOR_EACH_##t##0
#define CLES_DETAIL_PICK(_0, _1, _2, _3, _4, _5, _6, _7, _8, _9, _10, _11, _12, _13, _14, _15, _16, _17, _18, _19,     \
                         _20, _21, _22, _23, _24, _25, _26, _27, _28, _29, _30, _31, _32, _33, _34, _35, _36, _37,     \
                         _38, _39, _40, _41, _42, _43, _44, _45, _46, _47, _48, _49, _50, _51, _52, _53, _54, _55,     \
                         _56, _57, _58, _59, _60, _61, _62, _63, _64, _65, _66, _67, _68, _69, _70, _71, _72, _73,     \
                         _74, _75, _76, _77, _78, _79, _80, _81, _82, _83, _84, _85, _86, _87, _88, _89, _90, _91,     \
                         _92, _93, _94, _95, _96, _97, _98, _99, _100, chosen, ...)                                    \
    chosen
#define CLES_DETAIL_COUNT(...) CLES_DETAIL_PICK(__VA_ARGS__)

#undef BOOST_DESCRIBE_PP_FOR_EACH
#define BOOST_DESCRIBE_PP_FOR_EACH(F, ...)                                                                             \
    BOOST_DESCRIBE_PP_EXPAND(BOOST_DESCRIBE_PP_EXPAND(                                                                 \
        CLES_DETAIL_COUNT(__VA_ARGS__, CLES_DETAIL_12_NONE, CLES_DETAIL_12_NONE, CLES_DETAIL_12_NONE,                  \
                          CLES_DETAIL_12_NONE, BOOST_DESCRIBE_PP_FOR_EACH_52, BOOST_DESCRIBE_PP_FOR_EACH_51,           \
                          BOOST_DESCRIBE_PP_FOR_EACH_50, CLES_DETAIL_TEN(4), CLES_DETAIL_TEN(3), CLES_DETAIL_TEN(2),   \
                          CLES_DETAIL_TEN(1), CLES_DETAIL_TEN()))(F, __VA_ARGS__))

#endif
