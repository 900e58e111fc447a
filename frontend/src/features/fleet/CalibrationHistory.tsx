import { useComputedColorScheme } from "@mantine/core";
import { IconAlertTriangle } from "@tabler/icons-react";
import { useCalibration, useVehicleFigure } from "../../api/calibration";
import type { FigureCard } from "../../api/types";
import { FigurePanel } from "../../charts/FigurePanel";
import { ErrorNotice } from "../../ui/ErrorNotice";
import classes from "./Fleet.module.css";

const EMPTY_PX = 96;
const heightOf = (card: FigureCard | undefined, ready: number) => (card?.state === "ready" ? ready : EMPTY_PX);

/** Fitted parameters of the vehicle over its flights, whether they changed, and its batteries. */
export function CalibrationHistory({ vehicleId }: { vehicleId: number }) {
  const theme = useComputedColorScheme("light");
  const known = useCalibration(vehicleId);
  const calibration = useVehicleFigure(vehicleId, "calibration", theme);
  const batteries = useVehicleFigure(vehicleId, "batteries", theme);
  const retune = known.data?.retune;
  return (
    <>
      <div className={`${classes["wide"]} ${classes["stack"]}`}>
        <ErrorNotice error={known.error} />
        {retune?.due && (
          <p className={classes["due"]} role="status">
            <IconAlertTriangle size={20} aria-hidden />
            <span>
              <strong>Re-tune due.</strong> {retune.sentence}
            </span>
          </p>
        )}
        <FigurePanel
          title="Calibration history"
          card={calibration.data}
          error={calibration.error}
          height={heightOf(calibration.data, 460)}
          note={retune && !retune.due && calibration.data?.state === "ready" ? retune.sentence : undefined}
        />
      </div>
      <FigurePanel
        title="Batteries"
        card={batteries.data}
        error={batteries.error}
        height={heightOf(batteries.data, 300)}
        className={classes["wide"]}
      />
    </>
  );
}
