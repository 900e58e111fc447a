import { IconCircleCheckFilled, IconCircleDashed } from "@tabler/icons-react";
import { gainTicks } from "../../lib/flyScreen";
import { gainText } from "../../lib/format";
import classes from "./Fly.module.css";

interface Props {
  asked: Readonly<Record<string, number>>;
  readBack: Readonly<Record<string, number>> | null;
  held: Readonly<Record<string, number>>;
  titles: Readonly<Record<string, string>>;
}

/** Each gain of the flight, ticked once the vehicle has said that it holds it. */
export function Gains({ asked, readBack, held, titles }: Props) {
  return (
    <table className={`${classes["gains"]} numbers`}>
      <caption className="visually-hidden">Gains of this flight and whether the vehicle holds them</caption>
      <tbody>
        {gainTicks(asked, readBack, held).map(({ name, asked: value, held: found, confirmed }) => (
          <tr key={name} data-confirmed={confirmed || undefined}>
            <th scope="row">
              {name} <small>{titles[name]}</small>
            </th>
            <td>{gainText(value)}</td>
            <td className={classes["tick"]}>
              {confirmed ? (
                <>
                  <IconCircleCheckFilled size={22} aria-hidden />
                  <span className="visually-hidden">read back</span>
                </>
              ) : (
                <>
                  <small>{found === null ? "not read" : `holds ${gainText(found)}`}</small>
                  <IconCircleDashed size={22} aria-hidden />
                </>
              )}
            </td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}
