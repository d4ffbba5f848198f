from gym_server.budget import Budget


def test_all_together_hold_no_more_than_there_is():
    budget = Budget(10)
    one, other = budget.share(), budget.share()
    assert one.take(6)
    assert not other.take(5)
    assert other.take(4)
    one.give_back(1)
    assert other.take(1)


def test_what_was_given_back_is_not_given_back_again():
    budget = Budget(10)
    one, other = budget.share(), budget.share()
    assert one.take(5)
    assert other.take(5)
    one.give_all_back()
    one.give_back(5)
    one.give_all_back()
    assert not other.take(6)
    assert other.take(5)
