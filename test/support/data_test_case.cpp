// SPDX-License-Identifier: BSL-1.0
#include "support/data_test_case.hpp"

namespace cles::test {

boost::unit_test::test_unit* data_test_cases::next() const {
    if (next_ == count_) {
        return nullptr;
    }
    const auto index = next_++;
    const auto test = [parameter = parameter_, text = text_, run = run_, index] {
        BOOST_TEST_CONTEXT(parameter << " = " << text(index) << "; ") { run(index); }
    };
    return new boost::unit_test::test_case("_" + std::to_string(index), file_, line_, test); // Boost.Test owns it
}

} // namespace cles::test
