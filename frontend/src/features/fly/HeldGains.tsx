import { IconCircleCheckFilled, IconCircleDashed } from "@tabler/icons-react";
import { gainText } from "../../ui/format";
import classes from "./Fly.module.css";
import { type GainTick, gainTicks } from "./flyScreen";

interface Props {
  asked: Readonly<Record<string, number>>;
  readBack: Readonly<Record<string, number>> | null;
  held: Readonly<Record<string, number>>;
  titles: Readonly<Record<string, string>>;
  /** Whether the gains are staged; before that, none is marked as set. */
  areSet: boolean;
}

/** The gains of the flight, each ticked once it is read back. */
export function HeldGains({ asked, readBack, held, titles, areSet }: Props) {
  return (
    <table className={`${classes["gains"]} numbers`}>
      <caption className="visually-hidden">Gains of this flight, and whether they are set</caption>
      <tbody>
        {gainTicks(asked, readBack, held).map((tick) => (
          <tr key={tick.name}>
            <th scope="row">
              {tick.name} <small>{titles[tick.name]}</small>
            </th>
            <td>{gainText(tick.asked)}</td>
            <td className={classes["tick"]}>{areSet ? <Tick tick={tick} /> : <Now held={tick.held} />}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function Now({ held }: { held: number | null }) {
  return <small>{held === null ? "" : `now ${gainText(held)}`}</small>;
}

function Tick({ tick: { held, confirmed } }: { tick: GainTick }) {
  if (confirmed) return <IconCircleCheckFilled size={22} aria-label="read back" className={classes["confirmed"]} />;
  return (
    <>
      <small>{held === null ? "not read" : `now ${gainText(held)}`}</small>
      <IconCircleDashed size={22} aria-hidden />
    </>
  );
}
