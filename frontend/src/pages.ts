/** All pages but the first, in one bundle that is loaded while the first page is idle. */

export { FlightPage } from "./features/campaign/flights/FlightPage";
export { ComparePage } from "./features/compare/ComparePage";
export { EditVehiclePage } from "./features/fleet/EditVehiclePage";
export { NewVehiclePage } from "./features/fleet/NewVehiclePage";
export { VehiclePage } from "./features/fleet/VehiclePage";
export { VehiclesPage } from "./features/fleet/VehiclesPage";
export { FlyPage } from "./features/fly/FlyPage";
export { JobsPage } from "./features/jobs/JobsPage";
export { ReproductionsPage } from "./features/jobs/ReproductionsPage";
export { FailureShapesPage } from "./features/log-analysis/FailureShapesPage";
export { LogAnalysisPage } from "./features/log-analysis/LogAnalysisPage";
export { LoggedVehiclePage } from "./features/log-analysis/LoggedVehiclePage";
export { LogPage } from "./features/log-analysis/LogPage";
export { NewCampaignPage } from "./features/new-campaign/NewCampaignPage";
export { SettingsPage } from "./features/settings/SettingsPage";
