import type { Trial } from "../../../api/types";
import { useKeys } from "../../../frame/useKeys";
import { wasFlown } from "../../../ui/states";

/** Keys that go from the shown flight to the next and the previous flown one, from none to the last; `go` is not called
 * where there is none. */
export function useFlightKeys(trials: readonly Trial[], shownId: number | undefined, go: (trial: Trial) => void): void {
  const jump = (by: number) => {
    const flown = trials.filter(({ state }) => wasFlown(state));
    const at = flown.findIndex(({ id }) => id === shownId);
    const beside = flown[(at < 0 ? flown.length : at) + by];
    if (beside !== undefined) go(beside);
  };
  useKeys({ next: () => jump(1), previous: () => jump(-1) });
}
