// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/test/data/test_case.hpp>
#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <iterator>
#include <sstream>
#include <string>
#include <type_traits>

namespace cles::test {

/// A test case for each element of a range, which is named when one fails.
class data_test_cases final : public boost::unit_test::test_unit_generator {
  public:
    /// \param text  an element as it is printed
    /// \param run   the test of an element
    data_test_cases(boost::unit_test::const_string file, std::size_t line, const char* parameter, std::size_t count,
                    std::string (*text)(std::size_t index), void (*run)(std::size_t index))
        : file_(file), line_(line), parameter_(parameter), count_(count), text_(text), run_(run) {}

    [[nodiscard]] boost::unit_test::test_unit* next() const override;

  private:
    const boost::unit_test::const_string file_;
    const std::size_t line_;
    const char* const parameter_;
    const std::size_t count_;
    std::string (*const text_)(std::size_t index);
    void (*const run_)(std::size_t index);
    mutable std::size_t next_ = 0;
};

template <const auto& Values>
std::string element_text(std::size_t index) {
    std::ostringstream out;
    out << boost::test_tools::tt_detail::print_helper(*std::next(std::begin(Values), std::ptrdiff_t(index)));
    return std::move(out).str();
}

} // namespace cles::test

// BOOST_DATA_TEST_CASE for one parameter and an array of the namespace, with the same names of test cases. Boost's
// takes a tenth of the time that such tests take to compile, since each test is a template there.
#define CLES_DATA_TEST_CASE(name, values, parameter)                                                                   \
    struct name##_case : BOOST_AUTO_TEST_CASE_FIXTURE {                                                                \
        using element = std::remove_cvref_t<decltype(*std::begin(values))>;                                            \
        static void run(std::size_t index) {                                                                           \
            name##_case{}.check(*std::next(std::begin(values), std::ptrdiff_t(index)));                                \
        }                                                                                                              \
        void check(const element& parameter);                                                                          \
    };                                                                                                                 \
    BOOST_AUTO_TEST_SUITE(name, *boost::unit_test::decorator::stack_decorator())                                       \
    BOOST_AUTO_TU_REGISTRAR(name##_case)                                                                               \
    (boost::shared_ptr<boost::unit_test::test_unit_generator>(new cles::test::data_test_cases(                         \
         __FILE__, __LINE__, #parameter, std::size(values), &cles::test::element_text<values>, &name##_case::run)),    \
     boost::unit_test::decorator::collector_t::instance());                                                            \
    BOOST_AUTO_TEST_SUITE_END()                                                                                        \
    void name##_case::check(const element& parameter)
