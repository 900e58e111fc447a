import type { Trial } from "../../../api/types";
import { asSentence } from "../../../ui/format";
import { Note } from "../../../ui/Note";
import { FailureNotice } from "../../../ui/Notices";
import { isWithdrawnByOperator } from "../verdict/verdict";

/** Why a planned trial's last flight was not flown: a note if the operator chose so. Renders nothing without a reason. */
export function FlightProblem({ flight }: Pick<Trial, "flight">) {
  if (isWithdrawnByOperator({ flight })) return <Note fz="body">{asSentence(flight?.problem ?? "")}</Note>;
  return <FailureNotice reason={flight?.problem ?? ""} />;
}
