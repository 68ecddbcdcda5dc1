// SPDX-License-Identifier: BSL-1.0
#include "transport/lookup_error.hpp"

#include <boost/system/errc.hpp>

#include <string>

namespace cles::transport {
namespace {

namespace conditions = boost::system::errc;

class lookup_error_category final : public boost::system::error_category {
  public:
    constexpr lookup_error_category() noexcept : error_category(0x5D0E'A6C1'37F2'84B9U) {} // see protocol/error.cpp

    [[nodiscard]] const char* name() const noexcept override { return "cles.lookup"; }

    [[nodiscard]] std::string message(int value) const override {
        switch (static_cast<lookup_errc>(value)) {
        case lookup_errc::timed_out: return "the name of its host could not be looked up in time";
        case lookup_errc::no_thread:
            return "the name of its host could not be looked up, because the system refuses a thread";
        case lookup_errc::too_many:
            return "the name of its host could not be looked up, because too many others are being looked up";
        case lookup_errc::no_answer: return "none of the addresses of its host answered in time";
        }
        return "the name of its host could not be looked up";
    }

    [[nodiscard]] boost::system::error_condition default_error_condition(int value) const noexcept override {
        switch (static_cast<lookup_errc>(value)) {
        case lookup_errc::timed_out:
        case lookup_errc::no_answer: return conditions::make_error_condition(conditions::timed_out);
        case lookup_errc::no_thread:
        case lookup_errc::too_many: return conditions::make_error_condition(conditions::resource_unavailable_try_again);
        }
        return {value, *this};
    }
};

} // namespace

const boost::system::error_category& lookup_category() noexcept {
    static const lookup_error_category instance;
    return instance;
}

} // namespace cles::transport
